import { css } from 'lit';

/** Looks of the upload page, beside {@link pageLayout}. */
export const uploadStyle = css`
  .page {
    display: grid;
    gap: var(--cager-space-4);
    max-width: 820px;
  }
  .back {
    width: 36px;
    min-height: 36px;
    padding: 0;
    border-radius: 50%;
    color: var(--cager-text);
  }
  h2 {
    margin: 0;
    font-size: var(--cager-size-large);
    overflow-wrap: anywhere;
  }
  p {
    margin: 0;
  }
  .zone {
    display: grid;
    justify-items: center;
    gap: var(--cager-space-3);
    padding: var(--cager-space-7) var(--cager-space-5);
    border: 2px dashed var(--cager-line-strong);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
    text-align: center;
    transition:
      border-color var(--cager-fast),
      background var(--cager-fast);
  }
  .zone.small {
    padding: var(--cager-space-4);
  }
  .zone.over {
    border-color: var(--cager-accent);
    background: var(--cager-accent-soft);
  }
  .zone svg.glyph {
    width: 32px;
    height: 32px;
    color: var(--cager-accent);
  }
  .zone .buttons,
  .buttons {
    display: flex;
    flex-wrap: wrap;
    gap: var(--cager-space-2);
  }
  .kinds {
    display: grid;
    grid-template-columns: repeat(3, 1fr);
    gap: var(--cager-space-3);
    margin: 0;
    padding: 0;
    list-style: none;
  }
  .kinds li {
    padding: var(--cager-space-4);
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius);
    background: var(--cager-surface);
  }
  .kinds b {
    display: block;
  }
  .kinds span {
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .card {
    display: grid;
    gap: var(--cager-space-4);
    padding: var(--cager-space-5);
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
  }
  .items {
    display: grid;
    margin: 0;
    padding: 0;
    list-style: none;
  }
  .items li {
    display: grid;
    grid-template-columns: 1fr auto 150px;
    gap: var(--cager-space-2) var(--cager-space-4);
    align-items: center;
    padding: var(--cager-space-2) 0;
  }
  .items li + li {
    border-top: 1px solid var(--cager-line);
  }
  .items .title {
    min-width: 0;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
    font-weight: 600;
  }
  .items .unused {
    color: var(--cager-muted);
    font-weight: 400;
  }
  .items .remark {
    grid-column: 1 / -1;
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .options {
    display: grid;
    grid-template-columns: repeat(auto-fill, minmax(220px, 1fr));
    gap: var(--cager-space-4);
  }
  .field {
    display: grid;
    align-content: start;
    gap: var(--cager-space-1);
  }
  .field label {
    font-size: var(--cager-size-small);
    font-weight: 600;
  }
  .field .hint {
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .field input,
  .field select,
  .items select {
    width: 100%;
    min-width: 0;
  }
  .wide {
    grid-column: 1 / -1;
  }
  summary {
    width: max-content;
    padding: var(--cager-space-1) 0;
    cursor: pointer;
  }
  details .options {
    margin-top: var(--cager-space-3);
  }
  .note {
    display: flex;
    gap: var(--cager-space-2);
  }
  .note.bad {
    padding: var(--cager-space-3) var(--cager-space-4);
    border-radius: var(--cager-radius);
    background: var(--cager-bad-soft);
  }
  .note.bad svg {
    color: var(--cager-bad);
  }
  .note svg {
    margin-top: 1px;
    color: var(--cager-muted);
  }
  .good {
    color: var(--cager-good);
  }
  progress {
    width: 100%;
    height: 8px;
  }
  .figuresRow {
    display: flex;
    flex-wrap: wrap;
    gap: var(--cager-space-1) var(--cager-space-5);
    color: var(--cager-muted);
  }
  .figuresRow b {
    color: var(--cager-text);
    font-weight: 600;
  }
  .steps {
    display: flex;
    flex-wrap: wrap;
    gap: var(--cager-space-2) var(--cager-space-4);
    margin: 0;
    padding: 0;
    list-style: none;
    color: var(--cager-muted);
  }
  .steps li {
    display: flex;
    align-items: center;
    gap: 6px;
  }
  .steps li[aria-current] {
    color: var(--cager-text);
    font-weight: 600;
  }
  .steps .mark {
    display: grid;
    place-items: center;
    width: 18px;
    height: 18px;
    border: 1.5px solid currentColor;
    border-radius: 50%;
    font-size: 11px;
  }
  .steps .done {
    color: var(--cager-good);
  }
  .steps .mark svg.glyph {
    width: 12px;
    height: 12px;
    stroke-width: 3;
  }
  .errors {
    margin: 0;
  }
  .errors figcaption {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 6px;
    margin-bottom: var(--cager-space-1);
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .errors .scale {
    margin-left: auto;
  }
  .errors .key {
    width: 12px;
    height: 3px;
    border-radius: 2px;
  }
  .errors .key.mean {
    margin-left: var(--cager-space-2);
    background: var(--cager-accent);
  }
  .errors .key.worst {
    background: var(--cager-cage);
  }
  .errors svg {
    display: block;
    width: 100%;
    height: 120px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
  }
  .errors path {
    fill: none;
    stroke-width: 1.5;
    stroke-linecap: round;
    vector-effect: non-scaling-stroke;
  }
  .errors path.mean {
    stroke: var(--cager-accent);
  }
  .errors path.worst {
    stroke: var(--cager-cage);
  }
  @media (max-width: 640px) {
    .page {
      padding: var(--cager-space-4) var(--cager-space-3) var(--cager-space-6);
    }
    .kinds {
      grid-template-columns: 1fr;
    }
    .card {
      padding: var(--cager-space-4);
    }
    .items li {
      grid-template-columns: 1fr auto;
    }
    .items select {
      grid-column: 1 / -1;
    }
  }
`;
