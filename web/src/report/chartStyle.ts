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
  h4 {
    margin: 0;
    font-size: var(--cager-size);
    font-weight: 600;
  }
  .plot {
    position: relative;
    border-radius: var(--cager-radius-small);
  }
  .u-wrap {
    font-family: var(--cager-font);
  }
  .u-select {
    background: var(--cager-accent-soft);
  }
  .u-cursor-x,
  .u-cursor-y {
    border-color: var(--cager-line-strong);
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
    font-size: var(--cager-size-small);
    color: var(--cager-text);
  }
  .legend button[aria-pressed='false'] {
    opacity: 0.62;
    text-decoration: line-through;
  }
  .legend i {
    width: 16px;
    height: 0;
    border-top: 2px solid;
  }
  .legend i.dashes {
    border-top-style: dashed;
  }
  .legend i.dots,
  .legend i.diamonds {
    width: 8px;
    height: 8px;
    border: 0;
    border-radius: 50%;
    background: currentColor;
  }
  .legend i.diamonds {
    border-radius: 1px;
    rotate: 45deg;
  }
  .reading {
    flex: 1;
    min-width: 0;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
    font-size: var(--cager-size-small);
    color: var(--cager-muted);
  }
`;
