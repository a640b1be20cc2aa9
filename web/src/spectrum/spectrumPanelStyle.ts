import { css } from 'lit';

/** Beside the model in a wide picture, above the timeline in a narrow one; the viewer says how high that is. */
export const spectrumPanelStyle = css`
  :host {
    position: absolute;
    z-index: 2;
    left: var(--cager-space-3);
    top: calc(var(--cager-space-3) + 62px);
    bottom: calc(var(--deck-height, 120px) + var(--cager-space-3));
    width: 300px;
    display: flex;
    pointer-events: none;
  }
  .panel {
    pointer-events: auto;
    align-self: flex-start;
    width: 100%;
    max-height: 100%;
    display: flex;
    flex-direction: column;
    background: color-mix(in srgb, var(--cager-surface) 95%, transparent);
    border: 1px solid color-mix(in srgb, var(--cager-line) 75%, transparent);
    border-radius: var(--cager-radius-large);
    box-shadow: var(--cager-shadow);
    font-size: 13px;
  }
  header {
    display: flex;
    align-items: center;
    padding: 4px 4px 4px var(--cager-space-3);
    border-bottom: 1px solid var(--cager-line);
  }
  h2 {
    flex: 1;
    margin: 0;
    font-size: 14px;
    font-weight: 650;
  }
  .body {
    overflow: hidden auto;
    padding: var(--cager-space-2) var(--cager-space-3) var(--cager-space-3);
    min-height: 0;
  }
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
