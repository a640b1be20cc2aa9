import { css } from 'lit';

/** Layout of the viewer: the picture fills it, everything else floats above. */
export const viewerStyle = css`
  :host {
    position: relative;
    display: block;
    overflow: hidden;
    height: 100%;
    contain-intrinsic-block-size: 260px;
    background: var(--cager-stage);
    container-type: size;
    -webkit-tap-highlight-color: transparent;
  }
  .pane {
    position: absolute;
    inset: 0;
    overflow: hidden;
  }
  canvas {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    display: block;
    cursor: grab;
    touch-action: none;
  }
  canvas:active {
    cursor: grabbing;
  }
  canvas:focus-visible {
    outline-offset: -3px;
  }
  .glass {
    background: var(--cager-glass);
    border: 1px solid color-mix(in srgb, var(--cager-line) 75%, transparent);
    border-radius: var(--cager-radius-large);
    box-shadow: var(--cager-shadow);
    backdrop-filter: blur(14px) saturate(1.3);
  }
  :host([plain]) .glass {
    backdrop-filter: none;
    background: color-mix(in srgb, var(--cager-surface) 94%, transparent);
  }
  .lead {
    position: absolute;
    top: var(--cager-space-3);
    left: var(--cager-space-3);
    max-width: calc(100% - 92px);
    display: flex;
    align-items: flex-start;
    gap: var(--cager-space-2);
    pointer-events: none;
  }
  .lead > * {
    pointer-events: auto;
  }
  .title {
    display: flex;
    flex-direction: column;
    min-width: 0;
    padding: 7px var(--cager-space-3) 8px;
  }
  h1 {
    margin: 0;
    font-size: 15px;
    font-weight: 650;
    line-height: 1.3;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .title p {
    margin: 0;
    font-size: var(--cager-size-small);
    color: var(--cager-muted);
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .live {
    display: inline-flex;
    align-items: center;
    gap: 6px;
    min-height: 30px;
    margin-top: 2px;
    padding: 0 10px;
    border-radius: 99px;
    border: 0;
    background: var(--cager-live);
    color: light-dark(#ffffff, #2b0509);
    font-size: var(--cager-size-small);
    font-weight: 700;
    letter-spacing: 0.04em;
  }
  .live.behind,
  .live.behind:hover:not(:disabled) {
    background: var(--cager-raised);
    color: var(--cager-text);
    border: 1px solid var(--cager-line-strong);
  }
  .live::before {
    content: '';
    width: 8px;
    height: 8px;
    border-radius: 50%;
    background: currentColor;
  }
  .live:not(.behind)::before {
    animation: pulse 1.6s ease-in-out infinite;
  }
  @keyframes pulse {
    50% {
      opacity: 0.25;
    }
  }
  .tools {
    position: absolute;
    top: var(--cager-space-3);
    right: var(--cager-space-3);
    max-height: calc(100% - var(--covered-height, 120px) - 2 * var(--cager-space-3));
    display: flex;
    flex-direction: column;
    gap: 2px;
    padding: 4px;
    overflow: hidden auto;
    scrollbar-width: none;
  }
  .tools hr {
    flex: none;
    width: 22px;
    height: 1px;
    margin: 3px auto;
    border: 0;
    background: var(--cager-line);
  }
  .tools button {
    flex: none;
  }
  .deck {
    position: absolute;
    left: var(--cager-space-3);
    right: var(--cager-space-3);
    bottom: var(--cager-space-3);
    padding: var(--cager-space-2) var(--cager-space-2) 2px;
  }
  .transport {
    display: flex;
    align-items: center;
    gap: 2px;
    min-width: 0;
  }
  .title .lost {
    color: var(--cager-bad);
  }
  .transport .play {
    width: 42px;
    height: 42px;
    min-height: 0;
    margin: 0 4px;
    border-radius: 50%;
  }
  .transport .play svg {
    width: 22px;
    height: 22px;
  }
  .place {
    display: flex;
    gap: var(--cager-space-3);
    margin-left: var(--cager-space-2);
    white-space: nowrap;
  }
  .place [data-place] {
    font-weight: 600;
  }
  .errors {
    margin-left: auto;
    display: flex;
    gap: var(--cager-space-4);
    padding: 0 var(--cager-space-3);
    font-size: var(--cager-size-small);
    white-space: nowrap;
  }
  .errors dl,
  .errors div {
    margin: 0;
    display: flex;
    align-items: center;
    gap: 6px;
  }
  .errors dt {
    color: var(--cager-muted);
  }
  .errors dd {
    margin: 0;
    min-width: 4.2em;
  }
  .errors i {
    display: block;
    width: 12px;
    height: 3px;
    border-radius: 2px;
    background: var(--cager-accent);
  }
  .errors .linf i {
    background: var(--cager-cage);
  }
  .spacer {
    margin-left: auto;
  }
  .transport select {
    min-height: var(--cager-control);
    field-sizing: content;
    padding: 0 2px 0 8px;
    border-color: transparent;
    background: transparent;
    cursor: pointer;
  }
  .transport select:hover {
    background: var(--cager-hover);
  }
  .transport option {
    background: var(--cager-surface);
    color: var(--cager-text);
  }
  .legend {
    position: absolute;
    left: var(--cager-space-3);
    bottom: calc(var(--deck-height, 120px) + 2 * var(--cager-space-3));
    width: min(260px, 60%);
    padding: var(--cager-space-2) var(--cager-space-3);
    font-size: var(--cager-size-small);
  }
  .legend .bar {
    height: 8px;
    margin: 5px 0 3px;
    border-radius: 4px;
  }
  .legend .ends {
    display: flex;
    justify-content: space-between;
    color: var(--cager-muted);
  }
  .notice,
  .progress {
    position: absolute;
    left: 50%;
    bottom: calc(var(--deck-height, 120px) + 2 * var(--cager-space-3));
    translate: -50% 0;
    width: max-content;
    max-width: min(560px, calc(100% - 24px));
    padding: var(--cager-space-2) var(--cager-space-3);
  }
  .notice {
    display: flex;
    align-items: center;
    gap: var(--cager-space-2);
    border-color: color-mix(in srgb, var(--cager-bad) 60%, transparent);
    background: var(--cager-surface);
    z-index: 3;
  }
  .notice::before {
    content: '';
    flex: none;
    width: 4px;
    align-self: stretch;
    border-radius: 2px;
    background: var(--cager-bad);
  }
  .progress {
    width: 250px;
    font-size: var(--cager-size-small);
  }
  .progress div {
    display: flex;
    justify-content: space-between;
    gap: var(--cager-space-3);
  }
  .progress .bar {
    display: block;
    height: 4px;
    margin-top: 6px;
    border-radius: 2px;
    overflow: hidden;
    background: var(--cager-line);
  }
  .progress .bar div {
    display: block;
    height: 100%;
    background: var(--cager-accent);
    transform-origin: left;
  }
`;
