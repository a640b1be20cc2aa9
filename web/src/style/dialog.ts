import { css } from 'lit';

/** Looks of modal dialogs. Expects the tokens of the page. */
export const dialogStyle = css`
  dialog {
    padding: var(--cager-space-5);
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
    color: var(--cager-text);
    box-shadow: var(--cager-shadow);
  }
  dialog::backdrop {
    background: rgb(0 0 0 / 0.45);
  }
`;
