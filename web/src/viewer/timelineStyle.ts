import { css } from 'lit';

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
    position: relative;
    height: 44px;
    margin-block: 6px 8px;
    pointer-events: none;
  }
  .track {
    position: relative;
    height: 18px;
  }
  :is(.rail, .done) {
    position: absolute;
    inset: 7px 0;
    border-radius: 2px;
    background: color-mix(in srgb, var(--cager-muted) 32%, transparent);
  }
  .done {
    background: var(--cager-accent);
    transform-origin: left;
  }
  .lost {
    position: absolute;
    inset-block: 2px;
    margin-left: -1.5px;
    box-sizing: content-box;
    padding-right: 3px;
    border-radius: 2px;
    background: var(--cager-bad);
  }
  .outside {
    position: absolute;
    inset-block: 4px;
    z-index: 1;
    background: repeating-linear-gradient(45deg, var(--cager-muted) 0 2px, var(--cager-surface) 2px 6px);
  }
  .thumb {
    position: absolute;
    top: 2px;
    z-index: 2;
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
  :is(.needle, .hover) {
    position: absolute;
    inset-block: 0 12px;
    width: 1px;
    background: var(--cager-accent);
    pointer-events: none;
  }
  .hover {
    background: var(--cager-line-strong);
  }
  @media (max-height: 520px), (max-width: 560px) {
    .chart {
      height: 30px;
    }
  }
  @container (max-width: 320px) or (max-height: 220px) {
    :is(.chart, .needle, .hover) {
      display: none;
    }
  }
  @container (max-height: 480px) {
    .slider:has(~ cager-range-strip) :is(.chart, .needle, .hover) {
      display: none;
    }
  }
`;
