import { css } from 'lit';

/** What the panel of singular values holds. */
export const spectrumPanelStyle = css`
  .chart {
    height: 132px;
    cursor: crosshair;
    touch-action: none;
  }
  input[type='range'] {
    display: block;
    width: 100%;
    height: 26px;
    margin: 0 0 4px;
    border-radius: var(--cager-radius-small);
  }
  input[type='range']:focus-visible {
    outline-offset: -1px;
  }
  p {
    margin: var(--cager-space-2) 0 0;
  }
  .value {
    display: flex;
    justify-content: space-between;
    gap: var(--cager-space-2);
    margin: 0;
  }
  .bar {
    height: 8px;
    margin: var(--cager-space-2) 0 2px;
    border-radius: 4px;
  }
  .ends {
    display: flex;
    justify-content: space-between;
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .segments {
    display: flex;
    align-items: center;
    gap: 2px;
    margin-top: var(--cager-space-2);
  }
  .segments span {
    flex: 2;
    color: var(--cager-muted);
  }
  .segments button {
    flex: 1;
    min-height: 30px;
    padding: 0 4px;
    font-size: var(--cager-size-small);
  }
  dl {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: 2px var(--cager-space-3);
    margin: var(--cager-space-3) 0 0;
  }
  dt {
    color: var(--cager-muted);
  }
  dd {
    margin: 0;
    text-align: right;
  }
  @container (max-width: 680px) {
    :host {
      left: var(--cager-space-2);
      right: var(--cager-space-2);
      top: auto;
      bottom: calc(var(--deck-height, 120px) + var(--cager-space-2));
      width: auto;
      height: 38%;
    }
    .panel {
      align-self: flex-end;
    }
    .chart {
      height: 92px;
    }
  }
`;
