import { css } from 'lit';

export const tableStyle = css`
  .wide {
    margin: var(--cager-space-3) 0;
    overflow-x: auto;
  }
  table {
    border-collapse: collapse;
    font-size: 13px;
    font-variant-numeric: tabular-nums;
  }
  th,
  td {
    padding: 5px 10px;
    border-bottom: 1px solid var(--cager-line);
    text-align: right;
    white-space: nowrap;
  }
  th {
    color: var(--cager-muted);
    font-weight: 600;
    line-height: 1.3;
    vertical-align: bottom;
    white-space: normal;
  }
  .words {
    text-align: left;
  }
  th:first-child,
  td:first-child {
    padding-left: 0;
  }
  .quiet td {
    color: var(--cager-muted);
  }
  td .sentence {
    display: block;
    min-width: 240px;
    max-width: 400px;
    white-space: normal;
  }
  td .note-cell {
    display: block;
    color: var(--cager-muted);
    text-align: left;
  }
  i.dot {
    display: inline-block;
    width: 10px;
    height: 10px;
    margin-right: 8px;
    border-radius: 2px;
    vertical-align: -1px;
  }
`;
