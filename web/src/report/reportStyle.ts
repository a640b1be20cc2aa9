import { css } from 'lit';

export const reportStyle = css`
  :host {
    display: block;
  }
  main {
    max-width: 1240px;
    margin: 0 auto;
    padding: var(--cager-space-6) var(--cager-space-5) var(--cager-space-7);
  }
  h1 {
    margin-bottom: var(--cager-space-2);
    font-size: 28px;
    line-height: 1.2;
    letter-spacing: -0.01em;
  }
  h2 {
    margin: var(--cager-space-7) 0 var(--cager-space-3);
    padding-top: var(--cager-space-4);
    border-top: 1px solid var(--cager-line);
    font-size: 20px;
    line-height: 1.3;
    scroll-margin-top: 96px;
    outline: none;
  }
  .system {
    margin-left: var(--cager-space-1);
    padding: 1px 8px;
    border-radius: 99px;
    background: var(--cager-accent-soft);
    color: var(--cager-accent);
    font: 600 var(--cager-text-small);
    vertical-align: 3px;
  }
  :is(p, ul) {
    max-width: 82ch;
    margin: var(--cager-space-2) 0;
  }
  li {
    margin-left: var(--cager-space-5);
    list-style: disc;
  }
  .lead {
    color: var(--cager-muted);
  }
  :is(.lead, .caption) b {
    color: var(--cager-text);
    font-weight: 600;
    overflow-wrap: anywhere;
  }
  :is(code, pre) {
    font-family: var(--cager-mono);
    font-size: 0.9em;
  }
  .cards {
    display: grid;
    grid-template-columns: repeat(auto-fit, minmax(min(100%, 320px), 1fr));
    gap: var(--cager-space-4);
    margin: var(--cager-space-4) 0;
  }
  .card {
    min-width: 0;
    padding: var(--cager-space-4);
  }
  .card .choice {
    margin: 2px 0 var(--cager-space-2);
    font: 600 var(--cager-text-large);
  }
  .card pre {
    margin: var(--cager-space-3) 0;
    padding: var(--cager-space-3);
    border-radius: var(--cager-radius);
    background: var(--cager-raised);
    white-space: pre-wrap;
    overflow-wrap: anywhere;
  }
  .bar {
    position: sticky;
    top: 0;
    z-index: 3;
    display: flex;
    align-items: center;
    gap: var(--cager-space-2) var(--cager-space-4);
    margin: var(--cager-space-4) calc(-1 * var(--cager-space-5)) 0;
    padding: var(--cager-space-2) var(--cager-space-5);
    border-bottom: 1px solid var(--cager-line);
    background: color-mix(in srgb, var(--cager-background) 94%, transparent);
    backdrop-filter: blur(8px);
  }
  nav {
    display: flex;
    gap: var(--cager-space-4);
    min-width: 0;
    overflow-x: auto;
    font-size: var(--cager-size-small);
    white-space: nowrap;
    scrollbar-width: thin;
  }
  nav a {
    padding: 6px 0;
  }
  nav a:not(:hover) {
    text-decoration: none;
  }
  .segments {
    flex: none;
    min-width: 0;
  }
  .segments label {
    position: relative;
    padding: 4px 10px;
    font-size: var(--cager-size-small);
  }
  .segments input {
    position: absolute;
    inset: 0;
    margin: 0;
    opacity: 0;
    cursor: pointer;
  }
  .segments label:has(:focus-visible) {
    outline: 2px solid var(--cager-accent);
  }
  .charts {
    display: grid;
    grid-template-columns: repeat(auto-fit, minmax(min(100%, 400px), 1fr));
    gap: var(--cager-space-5);
    margin: var(--cager-space-4) 0 var(--cager-space-2);
  }
  .charts > :only-child {
    max-width: 760px;
  }
  report-views {
    margin: var(--cager-space-5) 0 var(--cager-space-2);
  }
  .wide-view {
    --report-view-width: 100%;
    max-width: 760px;
  }
  .large-views {
    --report-view-width: 340px;
    --report-view-fill: auto-fit;
  }
  .caption {
    max-width: 100ch;
    color: var(--cager-muted);
    font-size: 13px;
  }
  .scale {
    display: inline-flex;
  }
  .scale i {
    width: 180px;
    height: 9px;
    border-radius: 3px;
  }
  .verdict {
    color: var(--cager-good);
    font-weight: 600;
  }
  .verdict.in-part {
    color: var(--cager-warning);
  }
  .verdict.fails {
    color: var(--cager-bad);
  }
  .refused {
    padding-left: var(--cager-space-3);
    border-left: 3px solid var(--cager-warning);
  }
  summary {
    color: var(--cager-accent);
    font-size: 13px;
  }
  footer {
    margin-top: var(--cager-space-7);
    padding-top: var(--cager-space-4);
    border-top: 1px solid var(--cager-line);
    color: var(--cager-muted);
    font-size: 13px;
  }
  .wide {
    margin: var(--cager-space-3) 0;
    overflow-x: auto;
  }
  table {
    font-size: 13px;
    font-variant-numeric: tabular-nums;
  }
  :is(th, td) {
    padding: 5px 10px;
    border-bottom: 1px solid var(--cager-line);
    text-align: right;
    white-space: nowrap;
  }
  th {
    font-weight: 600;
    line-height: 1.3;
    vertical-align: bottom;
    white-space: normal;
  }
  .words {
    text-align: left;
  }
  :is(th, td):first-child {
    padding-left: 0;
  }
  .quiet td {
    color: var(--cager-muted);
  }
  .sentence {
    display: block;
    min-width: 240px;
    max-width: 400px;
    white-space: normal;
  }
  .note-cell {
    display: block;
    text-align: left;
  }
  .dot {
    display: inline-block;
    width: 10px;
    height: 10px;
    margin-right: 8px;
    border-radius: 2px;
    vertical-align: -1px;
  }
  @media (max-width: 640px) {
    main {
      padding: var(--cager-space-4) var(--cager-space-4) var(--cager-space-6);
    }
    h1 {
      font-size: 22px;
    }
    h2 {
      scroll-margin-top: 132px;
    }
    .bar {
      flex-direction: column;
      align-items: start;
      margin-inline: calc(-1 * var(--cager-space-4));
      padding-inline: var(--cager-space-4);
    }
    nav {
      flex-wrap: wrap;
      gap: 0 var(--cager-space-4);
    }
  }
  @media print {
    .bar {
      position: static;
    }
    :is(cager-chart, report-views) {
      break-inside: avoid;
    }
  }
`;
