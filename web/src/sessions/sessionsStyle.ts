import { css } from 'lit';

/** Looks of the list as a table, of what is there instead while it is empty, and of the question before something is deleted. */
export const sessionsStyle = css`
  .page {
    max-width: 1280px;
  }
  header,
  .bar {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: var(--cager-space-3);
    margin-bottom: var(--cager-space-3);
  }
  header {
    margin-bottom: var(--cager-space-5);
  }
  .search {
    position: relative;
    flex: 1 1 240px;
    max-width: 380px;
  }
  .search svg {
    position: absolute;
    inset: 0 auto 0 10px;
    margin: auto;
    color: var(--cager-muted);
    pointer-events: none;
  }
  .search input {
    width: 100%;
    padding-left: 36px !important;
  }
  .notice {
    align-items: center;
    margin-bottom: var(--cager-space-3);
  }
  .list {
    overflow: hidden;
  }
  table {
    width: 100%;
  }
  th {
    padding: var(--cager-space-2) var(--cager-space-3);
    border-bottom: 1px solid var(--cager-line);
    font: 500 var(--cager-text-small);
    white-space: nowrap;
  }
  td {
    padding: 10px var(--cager-space-3);
  }
  :is(th, td):first-child {
    width: 26%;
    padding-left: var(--cager-space-4);
  }
  .number {
    text-align: right;
    white-space: nowrap;
    font-variant-numeric: tabular-nums;
  }
  tr.session {
    position: relative;
    transition: background var(--cager-fast);
  }
  tbody + tbody tr.session {
    border-top: 1px solid var(--cager-line);
  }
  tbody:hover {
    background: color-mix(in srgb, var(--cager-raised) 55%, transparent);
  }
  :is(.name, .facts) {
    max-width: 340px;
  }
  .thumbnail {
    float: left;
    display: grid;
    place-content: center;
    width: 56px;
    height: 42px;
    margin-right: var(--cager-space-3);
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
    color: var(--cager-line-strong);
    object-fit: cover;
  }
  .brand {
    display: flex;
    align-items: center;
    gap: 6px;
    color: var(--cager-muted);
    font-weight: 650;
  }
  .about {
    max-width: min(62ch, 100%);
    margin-top: var(--cager-space-5);
  }
  .about > summary {
    color: var(--cager-muted);
  }
  .about dl {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 4px var(--cager-space-4);
    margin-top: var(--cager-space-3);
  }
  .about dt {
    font-weight: 600;
  }
  .name {
    display: block;
    color: var(--cager-text);
    font-weight: 600;
    text-decoration: none;
  }
  .name::after {
    content: '';
    position: absolute;
    inset: 0;
  }
  .name:focus-visible {
    outline: none;
  }
  .name:focus-visible::after {
    outline: 2px solid var(--cager-accent);
    outline-offset: -2px;
    border-radius: var(--cager-radius-small);
  }
  tbody:hover .name {
    color: var(--cager-accent);
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
  progress {
    width: 120px;
    height: 4px;
    margin-top: 5px;
  }
  .actions {
    position: relative;
    z-index: 1;
    justify-content: flex-end;
    gap: 2px;
  }
  .actions select {
    width: 6.4em;
    padding: 0.2em;
    border-color: transparent;
    background: none;
    font-size: 0.85em;
  }

  .actions button {
    min-height: 32px;
    width: 32px;
    padding: 0;
    border-color: transparent;
    background: transparent;
    color: var(--cager-muted);
  }
  .actions button:hover:not(:disabled) {
    background: var(--cager-hover);
    color: var(--cager-text);
  }
  .actions .remove:hover:not(:disabled) {
    color: var(--cager-bad);
  }
  .more td {
    padding-top: 0;
    padding-bottom: var(--cager-space-3);
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
  }
  .problem {
    display: flex;
    gap: var(--cager-space-2);
    max-width: 90ch;
    color: var(--cager-bad);
  }
  .problem.mild {
    padding-top: var(--cager-space-2);
    color: var(--cager-warning);
  }
  .pager {
    justify-content: flex-end;
    gap: var(--cager-space-3);
    margin-top: var(--cager-space-3);
  }
  .nothing {
    padding: var(--cager-space-7) var(--cager-space-5);
    text-align: center;
  }
  .placeholder {
    height: 58px;
    border-bottom: 1px solid var(--cager-line);
  }
  dialog {
    max-width: min(460px, calc(100vw - 32px));
  }
  dialog p {
    margin-bottom: var(--cager-space-5);
  }
  dialog .buttons {
    justify-content: flex-end;
  }
  .first {
    display: grid;
    gap: var(--cager-space-5);
    max-width: 680px;
    margin: var(--cager-space-6) auto 0;
  }
  .first img {
    width: 100%;
    height: auto;
  }
  .first p {
    color: var(--cager-muted);
  }
  .ways {
    display: grid;
    gap: var(--cager-space-3);
  }
  .ways li {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: var(--cager-space-2) var(--cager-space-4);
    align-items: center;
    padding: var(--cager-space-4) var(--cager-space-5);
  }
  .command {
    grid-column: 1 / -1;
  }
  code {
    padding: var(--cager-space-2) var(--cager-space-3);
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
    font: var(--cager-size-small) / 1.6 var(--cager-mono);
    overflow-wrap: anywhere;
  }
  @media (min-width: 861px) {
    .session:has(+ .more) td {
      padding-bottom: 6px;
    }
  }
  @media (prefers-reduced-motion: no-preference) {
    :is(.dot.running, .placeholder) {
      animation: pulse 1.6s ease-in-out infinite;
    }
    .placeholder {
      background: var(--cager-raised);
    }
  }
  @keyframes pulse {
    50% {
      opacity: 0.35;
    }
  }
`;
