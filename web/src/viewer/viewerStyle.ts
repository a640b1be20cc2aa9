import { css } from 'lit';

/** Layout of the viewer: one picture or two fill it, everything else floats above. */
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
    --above-deck: calc(var(--deck-height, 120px) + 2 * var(--cager-space-3));
  }
  :is(.pane, canvas) {
    position: absolute;
    inset: 0;
    overflow: hidden;
  }
  :host([pictures='columns']) .pane {
    right: calc(100% - var(--first-width));
  }
  :host([pictures='columns']) .pane.second {
    inset: 0 0 0 var(--first-width);
    box-shadow: -1px 0 var(--cager-line-strong);
  }
  :host([pictures='rows']) .pane {
    bottom: calc((100% + var(--covered-height)) / 2);
  }
  :host([pictures='rows']) .pane.second {
    top: calc((100% - var(--covered-height)) / 2);
    bottom: var(--covered-height);
    box-shadow: 0 -1px var(--cager-line-strong);
  }
  canvas {
    width: 100%;
    height: 100%;
    cursor: grab;
    touch-action: none;
  }
  canvas:active {
    cursor: grabbing;
  }
  canvas:focus-visible {
    outline-offset: -3px;
  }
  :host([plain]) .glass {
    backdrop-filter: none;
    background: color-mix(in srgb, var(--cager-surface) 94%, transparent);
  }
  .corner {
    position: absolute;
    top: var(--cager-space-3);
    left: var(--cager-space-3);
    max-width: calc(100% - 92px);
  }
  .lead {
    display: flex;
    align-items: flex-start;
    gap: var(--cager-space-2);
    pointer-events: none;
  }
  .lead > * {
    pointer-events: auto;
  }
  .title {
    display: grid;
    grid-template-columns: minmax(0, 1fr) auto;
    min-width: 0;
    padding: 7px 6px 8px var(--cager-space-3);
  }
  .up {
    grid-area: 1 / 2 / span 2;
    align-self: center;
    margin-left: var(--cager-space-3);
    padding: 0 8px;
    border-color: var(--cager-line-strong);
    font-size: var(--cager-size-small);
    white-space: nowrap;
  }
  .title .lost {
    color: var(--cager-bad);
  }
  .caption {
    display: grid;
    grid-template-columns: minmax(0, 1fr) auto auto;
    padding: 7px 4px 8px var(--cager-space-3);
  }
  .caption .icon {
    grid-area: 1 / 3 / span 2;
    margin-left: var(--cager-space-2);
  }
  .dashes {
    display: inline-block;
    width: 16px;
    height: 2px;
    margin: 0 6px 4px 0;
    background: repeating-linear-gradient(90deg, currentColor 0 4px, transparent 4px 6px);
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
    font: 700 var(--cager-text-small);
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
  @media not (prefers-reduced-motion: reduce) {
    .live:not(.behind)::before {
      animation: pulse 1.6s ease-in-out infinite;
    }
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
  }
  @supports (animation-timeline: scroll()) {
    .tools {
      scrollbar-width: none;
    }
  }
  @container (max-height: 480px) and (min-aspect-ratio: 4/3) {
    .lead:has(~ :is(cager-edit-panel, cager-pose-panel)) {
      left: calc(328px + 2 * var(--cager-space-3));
      max-width: calc(100% - 328px - 140px);
    }
  }
  @container (max-height: 480px) and (min-width: 700px) {
    .tools > [role='group'] {
      grid-template-columns: 1fr 1fr;
    }
  }
  .tools > [role='group'] {
    flex: none;
    display: grid;
    gap: 2px;
  }
  .tools > [role='group'] + [role='group'] {
    padding-top: 4px;
    border-top: 1px solid var(--cager-line);
  }
  .tools .fine {
    grid-column: 1 / -1;
    padding-left: 6px;
  }
  :is(.tools .fine, .caption-text) {
    display: none;
  }
  @container (min-width: 900px) and (min-height: 740px) {
    .tools > [role='group'] {
      grid-template-columns: 1fr 1fr;
    }
    .tools :is(.fine, .caption-text) {
      display: block;
    }
    .tools button {
      flex-direction: column;
      gap: 1px;
      width: 68px;
      padding: 4px 0 3px;
    }
    .tools .caption-text {
      font-size: 11px;
      line-height: 1.2;
    }
  }
`;
