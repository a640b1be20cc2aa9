import { css } from 'lit';
import { tableStyle } from './tableStyle';

const pageStyle = css`
  :host {
    display: block;
  }
  main {
    max-width: 1240px;
    margin: 0 auto;
    padding: var(--cager-space-6) var(--cager-space-5) var(--cager-space-7);
  }
  h1 {
    margin: 0 0 var(--cager-space-2);
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
  h2 .system {
    margin-left: var(--cager-space-1);
    padding: 1px 8px;
    border-radius: 99px;
    background: var(--cager-accent-soft);
    color: var(--cager-accent);
    font-size: var(--cager-size-small);
    font-weight: 600;
    vertical-align: 3px;
  }
  p {
    max-width: 82ch;
    margin: var(--cager-space-2) 0;
  }
  .lead {
    color: var(--cager-muted);
  }
  .lead b {
    color: var(--cager-text);
    font-weight: 600;
    overflow-wrap: anywhere;
  }
  code,
  pre {
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
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
  }
  .card h3 {
    margin: 0;
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
    font-weight: 600;
  }
  .card .choice {
    margin: 2px 0 var(--cager-space-2);
    font-size: var(--cager-size-large);
    font-weight: 600;
    line-height: 1.3;
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
  .bar nav {
    display: flex;
    gap: var(--cager-space-4);
    min-width: 0;
    overflow-x: auto;
    font-size: var(--cager-size-small);
    white-space: nowrap;
    scrollbar-width: thin;
  }
  .bar nav a {
    padding: 6px 0;
    text-decoration: none;
  }
  .bar nav a:hover {
    text-decoration: underline;
  }
  fieldset {
    display: flex;
    flex: none;
    align-items: center;
    margin: 0;
    padding: 2px;
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius);
    background: var(--cager-raised);
  }
  fieldset legend {
    position: absolute;
    width: 1px;
    height: 1px;
    overflow: hidden;
    clip-path: inset(50%);
  }
  fieldset label {
    position: relative;
    padding: 4px 10px;
    border-radius: var(--cager-radius-small);
    font-size: var(--cager-size-small);
    cursor: pointer;
  }
  fieldset input {
    position: absolute;
    inset: 0;
    margin: 0;
    opacity: 0;
    cursor: pointer;
  }
  fieldset label:has(:checked) {
    background: var(--cager-surface);
    color: var(--cager-accent);
    box-shadow: 0 0 0 1px var(--cager-line);
    font-weight: 600;
  }
  fieldset label:has(:focus-visible) {
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
  report-views.wide-view {
    --report-view-width: 100%;
    max-width: 760px;
  }
  report-views.large-views {
    --report-view-width: 340px;
    --report-view-fill: auto-fit;
  }
  .caption {
    max-width: 100ch;
    color: var(--cager-muted);
    font-size: 13px;
  }
  .caption b {
    color: var(--cager-text);
    font-weight: 600;
  }
  .scale {
    display: inline-flex;
    align-items: center;
    gap: var(--cager-space-2);
    font-size: var(--cager-size-small);
    color: var(--cager-muted);
  }
  .scale i {
    width: 180px;
    height: 9px;
    border-radius: 3px;
  }
  .verdict {
    font-weight: 600;
  }
  .verdict.holds {
    color: var(--cager-good);
  }
  .verdict.in-part {
    color: var(--cager-warning);
  }
  .verdict.fails {
    color: var(--cager-bad);
  }
  .note {
    padding: 2px 0 2px var(--cager-space-3);
    border-left: 3px solid var(--cager-warning);
  }
  details summary {
    color: var(--cager-accent);
    cursor: pointer;
    font-size: 13px;
  }
  footer {
    margin-top: var(--cager-space-7);
    padding-top: var(--cager-space-4);
    border-top: 1px solid var(--cager-line);
    color: var(--cager-muted);
    font-size: 13px;
  }
  @media (max-width: 640px) {
    main {
      padding: var(--cager-space-4) var(--cager-space-4) var(--cager-space-6);
    }
    h1 {
      font-size: 22px;
    }
    .bar {
      flex-direction: column;
      align-items: stretch;
      margin-inline: calc(-1 * var(--cager-space-4));
      padding-inline: var(--cager-space-4);
    }
    fieldset {
      align-self: flex-start;
    }
  }
  @media print {
    .bar {
      position: static;
    }
    report-chart,
    report-views {
      break-inside: avoid;
    }
  }
`;

export const reportStyle = [tableStyle, pageStyle];
