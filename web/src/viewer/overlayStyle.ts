import { css } from 'lit';

/** What lies above the picture for a while: figures, messages, what is compared, marks of points, the sheet of shortcuts. */
export const overlayStyle = css`
  .panel {
    position: absolute;
    top: var(--cager-space-3);
    right: calc(var(--cager-space-3) + var(--cager-control) + 18px);
    width: min(310px, calc(100% - 84px));
    max-height: calc(100% - var(--above-deck) - var(--cager-space-3));
    overflow: auto;
    padding: 6px var(--cager-space-4) var(--cager-space-4);
    font-size: 13px;
    z-index: 2;
  }
  .panel header {
    margin-right: -8px;
  }
  .panel h2 {
    color: var(--cager-muted);
    font: 650 var(--cager-text-small);
  }
  .panel p {
    margin-top: 6px;
  }
  .exports li button {
    width: 100%;
    font-weight: 500;
  }
  .parts ul {
    margin: 0 -8px var(--cager-space-3);
  }
  .parts li {
    min-height: var(--cager-control);
    padding: 0 8px;
    border-radius: var(--cager-radius-small);
    user-select: none;
    -webkit-touch-callout: none;
  }
  .parts li:hover {
    background: var(--cager-hover);
  }
  .parts li:has(:focus-visible) {
    outline: 2px solid var(--cager-accent);
  }
  .parts label {
    min-width: 0;
    min-height: inherit;
    cursor: pointer;
  }
  .parts li.off :is(label, .figures) {
    opacity: 0.55;
  }
  .panel > h2 {
    margin: var(--cager-space-3) 0 4px;
  }
  :is(.empty, .drop) {
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
  }
  .empty p {
    max-width: 34em;
    text-wrap: balance;
  }
  .empty > .glyph {
    width: 54px;
    height: 54px;
    stroke-width: 1.1;
    color: var(--cager-accent);
  }
  .drop {
    inset: var(--cager-space-3);
    border: 2px dashed var(--cager-accent);
    border-radius: var(--cager-radius-large);
    background: color-mix(in srgb, var(--cager-accent) 14%, var(--cager-glass));
    font: 600 var(--cager-text-large);
    pointer-events: none;
    z-index: 5;
  }
  .terms {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 4px var(--cager-space-4);
    margin: var(--cager-space-3) 0;
  }
  .terms dt {
    font-weight: 600;
  }
  .sheet > h3 {
    margin: var(--cager-space-4) 0 4px;
  }
  .sheet :is(th, td) {
    padding: 2px var(--cager-space-4) 2px 0;
    font-weight: 400;
  }
  .columns {
    display: grid;
    grid-template-columns: repeat(auto-fit, minmax(225px, 1fr));
    gap: var(--cager-space-5);
    margin-bottom: var(--cager-space-4);
  }
  .columns h3 {
    margin-bottom: 6px;
  }
  :is(.legend, .messages) {
    position: absolute;
    bottom: var(--above-deck);
  }
  :is(.legend, .toast, .progress) {
    padding: var(--cager-space-2) var(--cager-space-3);
  }
  .messages {
    inset-inline: 0;
    display: grid;
    justify-items: center;
    gap: var(--cager-space-2);
    pointer-events: none;
  }
  .messages > * {
    max-width: min(560px, calc(100% - 24px));
    pointer-events: auto;
  }
  .toast {
    position: relative;
    border-color: color-mix(in srgb, var(--cager-bad) 60%, transparent);
    border-left: 5px solid var(--cager-bad);
    background: var(--cager-surface);
    z-index: 3;
  }
  .progress {
    width: 250px;
    font-size: var(--cager-size-small);
  }
  .progress progress {
    width: 100%;
    height: 4px;
    margin-top: 6px;
  }
  .legend {
    left: var(--cager-space-3);
    width: min(300px, calc(100% - 84px));
    font-size: var(--cager-size-small);
  }
  .legend .bar {
    height: 8px;
    margin: 5px 0 3px;
    border-radius: 4px;
  }
  .legend .spread {
    gap: 0;
  }
  .legend.comparison {
    padding: var(--cager-space-3);
    z-index: 1;
  }
  .legend.beside {
    left: calc(319px + 2 * var(--cager-space-3));
  }
  .legend .pairs {
    margin: 6px 0;
  }
  .legend p {
    margin-bottom: var(--cager-space-2);
  }
  .legend .segments {
    margin-top: 6px;
  }
  .legend .segments button {
    padding: 0 4px;
  }
  .source {
    margin: -8px -8px 0 0;
  }
  .divider {
    position: absolute;
    top: 0;
    bottom: 0;
    left: var(--line, 50%);
    width: 28px;
    margin-left: -14px;
    cursor: ew-resize;
    touch-action: none;
  }
  .divider::before {
    content: '';
    position: absolute;
    inset: 0 13px;
    background: var(--cager-line-strong);
  }
  .divider::after {
    content: '';
    position: absolute;
    inset: calc(50% - 18px) 9px;
    border: 1px solid var(--cager-line-strong);
    border-radius: 5px;
    background: var(--cager-surface);
  }
  .divider:focus-visible {
    outline: none;
  }
  .divider:focus-visible::after {
    border: 2px solid var(--cager-accent);
  }
  :is(.divider, .mark) span {
    position: absolute;
    left: 22px;
    top: 74px;
    padding: 2px 8px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-surface);
    color: var(--cager-text);
    box-shadow: var(--cager-shadow);
    font-size: var(--cager-size-small);
    white-space: nowrap;
    pointer-events: none;
  }
  .divider .left {
    left: auto;
    right: 22px;
  }
  .mark {
    position: absolute;
    top: 0;
    left: 0;
    pointer-events: none;
  }
  .mark i {
    position: absolute;
    inset: -7px;
    width: 14px;
    height: 14px;
    border: 2px solid #ffffff;
    border-radius: 50%;
    box-shadow: 0 0 0 1.5px #000000;
  }
  .mark.probe i {
    inset: -4px;
    width: 8px;
    height: 8px;
  }
  .mark span {
    inset: -12px auto auto 14px;
  }
  .mark b {
    font-weight: inherit;
    white-space: pre;
  }
  .mark.flipped span {
    left: auto;
    right: 14px;
  }
  .mark.probe span {
    top: 8px;
  }
  @container (min-width: 900px) and (min-height: 740px) {
    .panel {
      right: calc(2 * var(--cager-space-3) + 148px);
    }
  }
  @container (max-height: 480px) and (min-width: 700px) {
    .panel {
      right: calc(2 * var(--cager-control) + 20px + var(--cager-space-3));
    }
  }
  @container (max-width: 680px) and (max-aspect-ratio: 4/3) {
    .panel {
      inset: auto calc(var(--cager-control) + 18px + var(--cager-space-2)) var(--above-deck) var(--cager-space-2);
      width: auto;
      max-height: 55%;
    }
    .panel.parts {
      max-height: 34%;
    }
    .legend.comparison {
      left: var(--cager-space-2);
    }
  }
  @container (max-width: 680px) {
    :is(.legend.beside, .panel ~ .legend, .mark b) {
      display: none;
    }
  }
`;
