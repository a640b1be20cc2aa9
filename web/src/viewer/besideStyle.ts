import { css } from 'lit';

/** Two pictures side by side or one above the other, and the caption of the second. */
export const besideStyle = css`
  :host([pictures='columns']) .pane {
    right: 50%;
  }
  :host([pictures='columns']) .pane.second {
    right: 0;
    left: 50%;
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
  .caption {
    position: absolute;
    top: var(--cager-space-3);
    left: var(--cager-space-3);
    max-width: calc(100% - 92px);
    display: grid;
    grid-template-columns: minmax(0, 1fr) auto;
    padding: 7px 4px 8px var(--cager-space-3);
  }
  .caption h2 {
    margin: 0;
    font-size: 15px;
    font-weight: 650;
    line-height: 1.3;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .caption button {
    grid-row: span 2;
    margin-left: var(--cager-space-2);
  }
  .dashes {
    display: inline-block;
    width: 16px;
    height: 2px;
    margin: 0 6px 4px 0;
    background: repeating-linear-gradient(90deg, currentColor 0 4px, transparent 4px 6px);
  }
  .caption p {
    margin: 0;
    font-size: var(--cager-size-small);
    color: var(--cager-muted);
  }
  @container (max-width: 680px) {
    .caption p:has(+ p) {
      display: none;
    }
  }
`;
