import { css } from 'lit';

export const editPanelStyle = css`
  .setting {
    margin: var(--cager-space-3) 0 4px;
    font-weight: 600;
  }
  output {
    font-weight: 400;
  }
  :is(p, ul) {
    margin-bottom: var(--cager-space-2);
  }
  .row strong {
    white-space: nowrap;
  }
  input[type='range'] {
    flex: 1;
    min-width: 0;
  }
  .segments {
    margin: var(--cager-space-1) 0;
  }
  :is(.row, .segments) > button:not(.icon),
  select {
    min-height: calc(var(--cager-control) - 4px);
    padding: 0 var(--cager-space-2);
    font-size: 13px;
  }
  .segments > button {
    padding: 0 4px;
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
  }
  li .name .figures {
    flex: none;
    white-space: nowrap;
  }
  li .layer {
    display: flex;
    justify-content: start;
    gap: var(--cager-space-2);
    min-width: 0;
    padding: 0 var(--cager-space-2);
  }
  li .layer .figures {
    margin-left: auto;
  }
  .range {
    display: grid;
    grid-template-columns: repeat(4, 1fr);
    gap: 4px;
    padding: 2px 4px 8px 0;
    font-size: 11px;
  }
  .range input {
    width: 100%;
    min-height: 28px;
    padding: 0 2px 0 6px;
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
    padding: 4px 0;
    font: 600 var(--cager-text-small);
  }
  footer {
    padding: var(--cager-space-2) var(--cager-space-3);
    border-top: 1px solid var(--cager-line);
  }
  footer button {
    flex: 1 1 auto;
  }
  progress {
    flex: 3;
    min-width: 0;
    height: 6px;
  }
  @container (max-width: 680px) and (max-aspect-ratio: 4/3) {
    .panel {
      align-self: stretch;
    }
    .body {
      flex: 1;
    }
  }
  @media (pointer: coarse) {
    input[type='checkbox'] {
      width: 22px;
      height: 22px;
    }
  }
`;
