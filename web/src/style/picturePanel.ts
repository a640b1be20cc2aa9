import { css } from 'lit';

/** Panels over the picture: beside the model in a wide one, above the timeline in a narrow one; the viewer says how high that is. In a low one all of a panel scrolls. */
export const picturePanelStyle = css`
  :host {
    position: absolute;
    z-index: 2;
    left: var(--cager-space-3);
    top: calc(var(--cager-space-3) + 62px);
    bottom: calc(var(--deck-height, 120px) + var(--cager-space-3));
    width: 328px;
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
    backdrop-filter: none;
    background: color-mix(in srgb, var(--cager-surface) 95%, transparent);
    font-size: 13px;
  }
  header {
    display: flex;
    align-items: center;
    padding: 4px 4px 4px var(--cager-space-3);
    border-bottom: 1px solid var(--cager-line);
  }
  h2 {
    font: 650 14px/1.45 var(--cager-font);
  }
  .body {
    overflow: hidden auto;
    padding: var(--cager-space-2) var(--cager-space-3) var(--cager-space-3);
    min-height: 0;
  }
  @container (max-width: 680px) and (max-aspect-ratio: 4/3) {
    :host {
      inset: auto var(--cager-space-2) calc(var(--deck-height, 120px) + var(--cager-space-2));
      width: auto;
      height: 37%;
    }
  }
  @container (max-height: 480px) {
    .panel {
      display: block;
      overflow: hidden auto;
    }
    .panel > header {
      position: sticky;
      top: 0;
      z-index: 1;
      background: var(--cager-surface);
    }
  }
  @container (max-height: 480px) and (min-aspect-ratio: 4/3) {
    :host {
      top: var(--cager-space-3);
    }
  }
`;
