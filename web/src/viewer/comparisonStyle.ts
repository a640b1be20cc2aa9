import { css } from 'lit';

/** The panel of a comparison, the line between its sides, and marks of points. */
export const comparisonStyle = css`
  .legend.comparison {
    width: min(300px, calc(100% - 84px));
    padding: var(--cager-space-3);
    z-index: 1;
  }
  .legend.beside {
    left: calc(283px + 2 * var(--cager-space-3));
  }
  .comparison p {
    margin: 0 0 var(--cager-space-2);
  }
  .comparison label {
    width: 100%;
    text-align: center;
    white-space: normal;
  }
  .comparison label:focus-visible {
    outline-offset: 1px;
  }
  .comparison dl {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: 2px var(--cager-space-3);
    margin: 6px 0 var(--cager-space-2);
  }
  .comparison dt {
    color: var(--cager-muted);
  }
  .comparison dd {
    margin: 0;
    text-align: right;
  }
  .comparison .remark {
    color: var(--cager-muted);
  }
  .source button {
    width: 30px;
    min-height: 30px;
  }
  .sides {
    display: grid;
    grid-template-columns: repeat(3, 1fr);
    gap: 2px;
  }
  .sides.two {
    grid-template-columns: repeat(2, 1fr);
    margin: 6px 0;
  }
  .sides button {
    min-height: 30px;
    padding: 0 4px;
    font-size: var(--cager-size-small);
  }
  .source {
    display: flex;
    align-items: center;
    gap: 4px;
    margin: -6px -6px 0 0;
  }
  .source span {
    flex: 1;
    min-width: 0;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .divider {
    position: absolute;
    top: 0;
    bottom: 0;
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
    top: calc(50% - 18px);
    left: 9px;
    width: 10px;
    height: 36px;
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
  .divider span {
    position: absolute;
    top: 74px;
    padding: 2px 8px;
    border-radius: 99px;
    background: var(--cager-surface);
    color: var(--cager-text);
    font-size: var(--cager-size-small);
    pointer-events: none;
    white-space: nowrap;
  }
  .divider .left {
    right: 22px;
  }
  .divider .right {
    left: 22px;
  }
  .mark {
    position: absolute;
    top: 0;
    left: 0;
    width: 0;
    height: 0;
    pointer-events: none;
  }
  .mark i {
    position: absolute;
    left: -7px;
    top: -7px;
    width: 14px;
    height: 14px;
    border: 2px solid #ffffff;
    border-radius: 50%;
    box-shadow: 0 0 0 1.5px #000000;
  }
  .mark.probe i {
    left: -4px;
    top: -4px;
    width: 8px;
    height: 8px;
  }
  .mark span {
    position: absolute;
    left: 14px;
    top: -12px;
    padding: 2px 8px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-surface);
    color: var(--cager-text);
    box-shadow: var(--cager-shadow);
    font-size: var(--cager-size-small);
    font-variant-numeric: tabular-nums;
    white-space: nowrap;
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
  @container (max-width: 680px) {
    .legend.comparison {
      left: var(--cager-space-2);
    }
    .legend.beside {
      display: none;
    }
    .mark b {
      display: none;
    }
  }
`;
