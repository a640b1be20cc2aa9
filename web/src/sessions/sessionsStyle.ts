import { css } from 'lit';

/** Looks of the list as a table, and of what is around it, beside {@link pageLayout}. */
export const sessionsStyle = css`
  .page {
    max-width: 1280px;
  }
  header {
    flex-wrap: wrap;
    margin-bottom: var(--cager-space-5);
  }
  .summary {
    display: flex;
    align-items: center;
    gap: var(--cager-space-2);
    color: var(--cager-muted);
  }
  .spacer {
    flex: 1;
  }
  .bar {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: var(--cager-space-3);
    margin-bottom: var(--cager-space-3);
  }
  .search {
    position: relative;
    flex: 1 1 240px;
    max-width: 380px;
  }
  .search svg {
    position: absolute;
    left: 10px;
    top: 50%;
    translate: 0 -50%;
    color: var(--cager-muted);
    pointer-events: none;
  }
  .search input {
    width: 100%;
    padding-left: 36px !important;
  }
  .states {
    display: flex;
    gap: 2px;
    padding: 2px;
    margin: 0;
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius);
    background: var(--cager-surface);
  }
  .states button {
    min-height: calc(var(--cager-control) - 6px);
    border-color: transparent;
    border-radius: 6px;
    background: transparent;
  }
  .states button[aria-pressed='true'] {
    background: var(--cager-accent-soft);
    font-weight: 600;
  }
  .notice {
    display: flex;
    align-items: center;
    gap: var(--cager-space-3);
    margin-bottom: var(--cager-space-3);
    padding: var(--cager-space-3) var(--cager-space-4);
    border-radius: var(--cager-radius);
    background: var(--cager-bad-soft);
  }
  .notice svg {
    color: var(--cager-bad);
  }
  .notice p {
    flex: 1;
    margin: 0;
  }
  .list {
    overflow: hidden;
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
  }
  table {
    width: 100%;
    border-collapse: collapse;
  }
  th {
    padding: var(--cager-space-2) var(--cager-space-3);
    border-bottom: 1px solid var(--cager-line);
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
    font-weight: 500;
    text-align: left;
    white-space: nowrap;
  }
  td {
    padding: 10px var(--cager-space-3);
    vertical-align: middle;
  }
  th:first-child,
  td:first-child {
    padding-left: var(--cager-space-4);
  }
  .number {
    text-align: right;
    white-space: nowrap;
    font-variant-numeric: tabular-nums;
  }
  tbody tr.session {
    position: relative;
    transition: background var(--cager-fast);
  }
  tbody + tbody tr.session {
    border-top: 1px solid var(--cager-line);
  }
  tbody:hover {
    background: color-mix(in srgb, var(--cager-raised) 55%, transparent);
  }
  a.name {
    display: block;
    overflow: hidden;
    max-width: 340px;
    color: var(--cager-text);
    font-weight: 600;
    text-decoration: none;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  a.name::after {
    content: '';
    position: absolute;
    inset: 0;
  }
  a.name:focus-visible {
    outline: none;
  }
  a.name:focus-visible::after {
    outline: 2px solid var(--cager-accent);
    outline-offset: -2px;
    border-radius: var(--cager-radius-small);
  }
  tbody:hover a.name {
    color: var(--cager-accent);
  }
  .facts {
    overflow: hidden;
    max-width: 340px;
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .state {
    display: inline-flex;
    align-items: center;
    gap: 7px;
    white-space: nowrap;
  }
  .dot {
    width: 8px;
    height: 8px;
    flex: none;
    border-radius: 50%;
    background: var(--cager-muted);
  }
  .dot.running {
    background: var(--cager-live);
  }
  .dot.preparing {
    background: transparent;
    border: 2px solid var(--cager-accent);
  }
  .dot.waiting {
    background: var(--cager-warning);
  }
  .dot.completed {
    background: var(--cager-good);
  }
  .dot.failed {
    background: var(--cager-bad);
    border-radius: 2px;
  }
  @media (prefers-reduced-motion: no-preference) {
    .dot.running {
      animation: pulse 1.6s ease-in-out infinite;
    }
  }
  @keyframes pulse {
    50% {
      opacity: 0.35;
    }
  }
  progress {
    width: 120px;
    height: 4px;
    margin-top: 5px;
  }
  .small {
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .actions {
    position: relative;
    z-index: 1;
    display: flex;
    justify-content: flex-end;
    gap: 2px;
  }
  .actions button,
  .actions .button {
    min-height: 32px;
    width: 32px;
    padding: 0;
    border-color: transparent;
    background: transparent;
    color: var(--cager-muted);
  }
  .actions button:hover:not(:disabled),
  .actions .button:hover {
    background: var(--cager-hover);
    color: var(--cager-text);
  }
  .actions button.remove:hover:not(:disabled) {
    color: var(--cager-bad);
  }
  tr.more td {
    padding-top: 0;
    padding-bottom: var(--cager-space-3);
  }
  @media (min-width: 861px) {
    .session:has(+ .more) td {
      padding-bottom: 6px;
    }
  }
  details[open] .problem {
    padding-top: var(--cager-space-2);
  }
  details {
    position: relative;
    z-index: 1;
    width: max-content;
    max-width: 100%;
  }
  summary {
    color: var(--cager-warning);
    font-size: var(--cager-size-small);
    cursor: pointer;
  }
  .problem {
    display: flex;
    gap: var(--cager-space-2);
    max-width: 90ch;
    margin: 0;
    color: var(--cager-bad);
  }
  .problem.mild {
    color: var(--cager-warning);
  }
  .problem svg {
    margin-top: 1px;
  }
  .pager {
    display: flex;
    align-items: center;
    justify-content: flex-end;
    gap: var(--cager-space-3);
    margin-top: var(--cager-space-3);
    color: var(--cager-muted);
  }
  .nothing {
    padding: var(--cager-space-7) var(--cager-space-5);
    text-align: center;
  }
  .placeholder {
    height: 58px;
    border-bottom: 1px solid var(--cager-line);
  }
  @media (prefers-reduced-motion: no-preference) {
    .placeholder {
      animation: pulse 1.8s ease-in-out infinite;
      background: var(--cager-raised);
    }
  }
`;
