import { css } from 'lit';

/** Looks of the timeline. */
export const timelineStyle = css`
  :host {
    display: block;
    touch-action: none;
    user-select: none;
  }
  .slider {
    position: relative;
    cursor: pointer;
    border-radius: var(--cager-radius-small);
  }
  .chart {
    height: 58px;
    pointer-events: none;
  }
  .u-wrap {
    font-family: var(--cager-font);
  }
  .track {
    position: relative;
    height: 18px;
  }
  .rail,
  .done {
    position: absolute;
    top: 7px;
    left: 0;
    height: 4px;
    width: 100%;
    border-radius: 2px;
    background: color-mix(in srgb, var(--cager-muted) 32%, transparent);
  }
  .done {
    background: var(--cager-accent);
    transform-origin: left;
  }
  .lost {
    position: absolute;
    top: 2px;
    height: 14px;
    margin-left: -1.5px;
    box-sizing: content-box;
    padding-right: 3px;
    border-radius: 2px;
    background: var(--cager-bad);
  }
  .thumb {
    position: absolute;
    top: 2px;
    left: 0;
    width: 14px;
    height: 14px;
    margin-left: -7px;
    border-radius: 50%;
    background: var(--cager-accent);
    border: 2px solid var(--cager-surface);
    box-shadow: 0 1px 4px rgb(0 0 0 / 0.35);
    transition: scale var(--cager-fast);
  }
  .slider:hover .thumb {
    scale: 1.2;
  }
  .needle,
  .hover {
    position: absolute;
    top: 0;
    bottom: 12px;
    width: 1px;
    background: var(--cager-accent);
    pointer-events: none;
  }
  .hover {
    background: var(--cager-line-strong);
  }
  .tip {
    position: absolute;
    bottom: calc(100% + 2px);
    padding: 3px 8px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-text);
    color: var(--cager-background);
    font-size: var(--cager-size-small);
    white-space: nowrap;
    translate: -50% 0;
    pointer-events: none;
    z-index: 2;
  }
  @media (max-height: 520px), (max-width: 560px) {
    .chart {
      height: 44px;
    }
  }
  @container (max-width: 320px) or (max-height: 220px) {
    .chart,
    .needle,
    .hover {
      display: none;
    }
  }
`;
