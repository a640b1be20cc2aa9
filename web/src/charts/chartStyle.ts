import { css } from 'lit';

export const chartStyle = css`
  :host {
    display: block;
    min-width: 0;
  }
  header {
    display: flex;
    flex-wrap: wrap;
    align-items: baseline;
    gap: 0 var(--cager-space-3);
    min-height: 22px;
  }
  .frame {
    display: grid;
    grid-template: 214px 40px / 22px 1fr;
    gap: 0;
    padding: 10px 14px 0 0;
  }
  .area {
    grid-column: 2;
    position: relative;
    margin-left: 36px;
    cursor: crosshair;
    touch-action: pan-y;
    user-select: none;
  }
  .name {
    align-self: end;
    grid-column: 2;
    padding-left: 36px;
    font-size: 11px;
    text-align: center;
  }
  .area + .name {
    grid-area: 1 / 1;
    align-self: center;
    justify-self: center;
    padding: 0;
    writing-mode: vertical-rl;
    text-orientation: sideways;
    rotate: 180deg;
    white-space: nowrap;
  }
  :is(.cursor, .range) {
    position: absolute;
    inset-block: 0;
    border-left: 1px dashed var(--cager-line-strong);
    pointer-events: none;
  }
  .range {
    border: 0;
    background: var(--cager-accent-soft);
  }
  .legend {
    display: flex;
    flex-wrap: wrap;
    gap: 0 2px;
    margin-top: var(--cager-space-1);
  }
  .legend button {
    min-height: 24px;
    padding: 0 6px;
    gap: 6px;
    border: 0;
    background: none;
    color: var(--cager-text);
    font-size: var(--cager-size-small);
  }
  .legend [aria-pressed='false'] {
    opacity: 0.62;
    text-decoration: line-through;
  }
  .legend i {
    width: 16px;
    border-top: 2px solid;
  }
  .legend .dashes {
    border-top-style: dashed;
  }
  .legend :is(.dots, .squares) {
    width: 8px;
    height: 8px;
    border: 0;
    border-radius: 50%;
    background: currentColor;
  }
  .legend .squares {
    border-radius: 1px;
  }
`;
