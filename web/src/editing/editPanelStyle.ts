import { css } from 'lit';

/** What the panel of edits holds. */
export const editPanelStyle = css`
  h3,
  .setting {
    display: flex;
    justify-content: space-between;
    margin: var(--cager-space-3) 0 4px;
    font-size: var(--cager-size-small);
    font-weight: 600;
    color: var(--cager-muted);
  }
  output {
    font-weight: 400;
  }
  p {
    margin: 0 0 var(--cager-space-2);
  }
  .row {
    display: flex;
    align-items: center;
    gap: var(--cager-space-2);
  }
  .row > strong {
    white-space: nowrap;
  }
  .row > strong,
  .row > input[type='range'],
  .row > .name {
    flex: 1;
    min-width: 0;
  }
  .row button:not(.icon),
  .segments button,
  select,
  footer button {
    min-height: 30px;
    padding: 0 var(--cager-space-2);
    font-size: 13px;
  }
  .row select {
    min-height: 30px;
    padding: 0 4px;
  }
  .segments {
    display: flex;
  }
  .tools {
    margin-top: var(--cager-space-2);
  }
  .segments button {
    flex: 1 1 auto;
    padding: 0 4px;
    border-radius: 0;
    margin-left: -1px;
    border-color: var(--cager-line-strong);
  }
  .segments button[aria-pressed='true'] {
    border-color: var(--cager-accent);
    z-index: 1;
  }
  .segments button:first-child {
    margin-left: 0;
    border-radius: var(--cager-radius) 0 0 var(--cager-radius);
  }
  .segments button:last-child {
    border-radius: 0 var(--cager-radius) var(--cager-radius) 0;
  }
  ul {
    list-style: none;
    margin: 0 0 var(--cager-space-2);
    padding: 0;
  }
  li {
    border-radius: var(--cager-radius);
    padding: 0 2px 0 6px;
  }
  li.active {
    background: var(--cager-accent-soft);
  }
  li .name {
    justify-content: space-between;
    padding: 0 4px;
  }
  .range {
    display: grid;
    grid-template-columns: repeat(4, 1fr);
    gap: 4px;
    padding: 2px 4px 8px 0;
  }
  .range label {
    font-size: 11px;
    color: var(--cager-muted);
  }
  .range input[type='number'] {
    width: 100%;
    min-height: 28px;
    padding: 0 2px 0 6px;
    border-radius: var(--cager-radius-small);
    font-size: 13px;
    color: var(--cager-text);
  }
  input[type='checkbox'] {
    width: 16px;
    height: 16px;
    margin: 0;
  }
  details {
    margin-top: var(--cager-space-2);
    color: var(--cager-muted);
  }
  summary {
    cursor: pointer;
    padding: 4px 0;
    font-size: var(--cager-size-small);
    font-weight: 600;
  }
  dl {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 4px var(--cager-space-2);
    margin: 0;
  }
  dd {
    margin: 0;
  }
  kbd {
    display: inline-block;
    min-width: 24px;
    padding: 0 5px;
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
    font: 11px var(--cager-mono);
    color: var(--cager-text);
    text-align: center;
    white-space: nowrap;
  }
  footer {
    display: flex;
    align-items: center;
    gap: var(--cager-space-2);
    padding: var(--cager-space-2) var(--cager-space-3);
    border-top: 1px solid var(--cager-line);
  }
  footer button {
    flex: 1 1 auto;
    gap: 4px;
  }
  footer progress {
    flex: 3;
    min-width: 0;
    accent-color: var(--cager-accent);
  }
  @container (max-width: 680px) {
    :host {
      left: var(--cager-space-2);
      right: var(--cager-space-2);
      top: auto;
      width: auto;
      height: 36%;
    }
    .panel {
      align-self: stretch;
    }
    .body {
      flex: 1;
    }
  }
  @media (pointer: coarse) {
    .row button:not(.icon),
    .segments button,
    select,
    footer button {
      min-height: 38px;
    }
    input[type='checkbox'] {
      width: 22px;
      height: 22px;
    }
  }
  @media (prefers-contrast: more) {
    .panel {
      border-width: 2px;
    }
  }
`;
