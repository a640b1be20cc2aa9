import { css } from 'lit';

/** What the list and the upload have in common: a page that scrolls, its heading, bars of progress. Expects the tokens and controls of the page. */
export const pageLayout = css`
  :host {
    display: block;
    flex: 1;
    min-height: 0;
    overflow: auto;
    background: var(--cager-background);
  }
  .page {
    margin: 0 auto;
    padding: var(--cager-space-6) var(--cager-space-5) var(--cager-space-7);
  }
  header {
    display: flex;
    align-items: center;
    gap: var(--cager-space-3);
  }
  h1 {
    margin: 0;
    font-size: var(--cager-size-title);
    line-height: 1.2;
    letter-spacing: -0.01em;
  }
  progress {
    display: block;
    border: 0;
    border-radius: 4px;
    overflow: hidden;
    appearance: none;
    background: var(--cager-line);
  }
  progress::-webkit-progress-bar {
    background: var(--cager-line);
  }
  progress::-webkit-progress-value {
    background: var(--cager-accent);
    transition: width var(--cager-slow);
  }
  progress::-moz-progress-bar {
    background: var(--cager-accent);
  }
`;
