import { css } from 'lit';

export const viewsStyle = css`
  :host {
    display: block;
  }
  .tools {
    flex-wrap: wrap;
    gap: var(--cager-space-1);
    margin-bottom: var(--cager-space-2);
  }
  .tools input {
    flex: 0 1 260px;
    min-width: 100px;
  }
  .tools output {
    min-width: 7em;
    color: var(--cager-text);
  }
  .tools .quiet {
    min-height: 28px;
    padding: 0 var(--cager-space-2);
  }
  .views {
    --small: 188px;
    display: grid;
    grid-template-columns: repeat(
      var(--report-view-fill, auto-fill),
      minmax(min(100%, var(--report-view-width, var(--small))), 1fr)
    );
    gap: var(--cager-space-2);
  }
  @media (max-width: 640px) {
    .views {
      --small: 150px;
    }
  }
  .views.large {
    grid-template-columns: repeat(auto-fill, minmax(min(100%, 400px), 1fr));
  }
  .views figure {
    display: flex;
    flex-direction: column;
    min-width: 0;
    border-radius: var(--cager-radius);
    overflow: hidden;
    background: linear-gradient(var(--cager-stage-top), var(--cager-stage));
  }
  canvas {
    display: block;
    width: 100%;
    aspect-ratio: var(--report-view-aspect);
    touch-action: pan-y;
    cursor: grab;
  }
  canvas:active {
    cursor: grabbing;
  }
  canvas:focus-visible {
    outline-offset: -2px;
  }
  figcaption {
    flex: 1;
    padding: var(--cager-space-2);
    background: var(--cager-surface);
    border-top: 1px solid var(--cager-line);
    line-height: 1.35;
  }
  figcaption b {
    display: block;
    color: var(--cager-text);
    font-weight: 600;
  }
  figcaption i {
    display: inline-block;
    width: 9px;
    height: 9px;
    margin-right: 6px;
    border-radius: 2px;
  }
`;
