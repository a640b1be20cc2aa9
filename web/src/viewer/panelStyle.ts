import { css } from 'lit';
import { dialogStyle } from '../style/dialog';

const ownStyle = css`
  .panel {
    position: absolute;
    top: var(--cager-space-3);
    right: calc(var(--cager-space-3) + var(--cager-control) + 18px);
    width: min(310px, calc(100% - 84px));
    max-height: calc(100% - var(--deck-height, 120px) - 3 * var(--cager-space-3));
    overflow: auto;
    padding: var(--cager-space-3) var(--cager-space-4) var(--cager-space-4);
    font-size: 13px;
    z-index: 2;
  }
  .panel h2 {
    margin: var(--cager-space-3) 0 4px;
    font-size: var(--cager-size-small);
    font-weight: 650;
    color: var(--cager-muted);
  }
  .panel header {
    display: flex;
    align-items: center;
    justify-content: space-between;
    margin: -6px -8px 0 0;
  }
  .panel header h2 {
    margin: 0;
  }
  .panel dl {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: 3px var(--cager-space-3);
    margin: 0;
  }
  .panel dt {
    color: var(--cager-muted);
  }
  .panel dd {
    margin: 0;
    text-align: right;
    font-variant-numeric: tabular-nums;
  }
  .empty,
  .drop {
    position: absolute;
    inset: 0;
    display: grid;
    place-content: center;
    justify-items: center;
    gap: var(--cager-space-3);
    padding: var(--cager-space-5);
    text-align: center;
  }
  .empty {
    background: radial-gradient(circle at 50% 38%, var(--cager-stage-top), var(--cager-stage));
  }
  .empty h1 {
    font-size: var(--cager-size-title);
    white-space: normal;
  }
  .empty p {
    max-width: 34em;
    margin: 0;
    color: var(--cager-muted);
    text-wrap: balance;
  }
  .empty > .glyph {
    width: 54px;
    height: 54px;
    stroke-width: 1.1;
    color: var(--cager-accent);
  }
  .empty .failure {
    color: var(--cager-text);
    background: var(--cager-bad-soft);
    border-radius: var(--cager-radius);
    padding: var(--cager-space-3) var(--cager-space-4);
  }
  .drop {
    inset: var(--cager-space-3);
    border: 2px dashed var(--cager-accent);
    border-radius: var(--cager-radius-large);
    background: color-mix(in srgb, var(--cager-accent) 14%, var(--cager-glass));
    font-size: var(--cager-size-large);
    font-weight: 600;
    pointer-events: none;
    z-index: 5;
  }
  dialog {
    max-width: min(880px, calc(100vw - 24px));
    max-height: calc(100dvh - 24px);
  }
  dialog.question h2 {
    margin: 0 0 var(--cager-space-4);
    overflow-wrap: anywhere;
  }
  .choices {
    display: flex;
    flex-wrap: wrap;
    gap: var(--cager-space-2);
  }
  dialog header {
    display: flex;
    align-items: center;
    justify-content: space-between;
    margin-bottom: var(--cager-space-3);
  }
  dialog h2 {
    margin: 0;
    font-size: 19px;
  }
  dialog .columns {
    display: grid;
    grid-template-columns: repeat(auto-fit, minmax(225px, 1fr));
    gap: var(--cager-space-5);
  }
  dialog h3 {
    margin: 0 0 6px;
    font-size: var(--cager-size-small);
    color: var(--cager-muted);
  }
  dialog dl {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 5px var(--cager-space-3);
    align-items: baseline;
    margin: 0;
    font-size: 13px;
  }
  dialog dd {
    margin: 0;
  }
  kbd {
    display: inline-block;
    min-width: 24px;
    padding: 1px 6px;
    border: 1px solid var(--cager-line);
    border-bottom-width: 2px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
    font: 12px var(--cager-mono);
    text-align: center;
    white-space: nowrap;
  }
  @container (max-width: 680px) {
    .panel {
      top: auto;
      right: calc(var(--cager-control) + 18px + var(--cager-space-2));
      left: var(--cager-space-2);
      bottom: calc(var(--deck-height, 120px) + 2 * var(--cager-space-3));
      width: auto;
      max-height: 55%;
    }
  }
`;

/** What lies above the picture for a while: figures, the empty state, the drop target, the sheet of shortcuts. */
export const panelStyle = [dialogStyle, ownStyle];
