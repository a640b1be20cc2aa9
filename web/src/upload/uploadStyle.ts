import { css } from 'lit';

export const uploadStyle = css`
  .page {
    display: grid;
    gap: var(--cager-space-4);
    max-width: 820px;
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
    transition: var(--cager-fast);
  }
  .zone.small {
    padding: var(--cager-space-4);
  }
  .zone.over {
    border-color: var(--cager-accent);
    background: var(--cager-accent-soft);
  }
  .zone > .glyph {
    width: 32px;
    height: 32px;
    color: var(--cager-accent);
  }
  .kinds {
    display: grid;
    grid-template-columns: repeat(3, 1fr);
    gap: var(--cager-space-3);
  }
  .kinds li {
    padding: var(--cager-space-4);
  }
  .kinds b {
    display: block;
  }
  .page > .card {
    display: grid;
    gap: var(--cager-space-4);
    padding: var(--cager-space-5);
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
  .items .title:not(.unused) {
    font-weight: 600;
  }
  .unused {
    color: var(--cager-muted);
  }
  :is(.items .remark, .wide) {
    grid-column: 1 / -1;
  }
  .options {
    display: grid;
    grid-template-columns: repeat(auto-fill, minmax(220px, 1fr));
    gap: var(--cager-space-4);
  }
  :is(.field, .items) :is(input, select) {
    width: 100%;
    min-width: 0;
  }
  summary {
    width: max-content;
    padding: var(--cager-space-1) 0;
  }
  details .options {
    margin-top: var(--cager-space-3);
  }
  .note svg {
    margin-top: 1px;
    color: var(--cager-muted);
  }
  :is(.good, .steps .done) {
    color: var(--cager-good);
  }
  progress {
    width: 100%;
    height: 8px;
  }
  :is(.figuresRow, .steps) {
    display: flex;
    flex-wrap: wrap;
    gap: var(--cager-space-1) var(--cager-space-5);
    color: var(--cager-muted);
  }
  .figuresRow b {
    color: var(--cager-text);
    font-weight: 600;
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
  .steps .mark .glyph {
    width: 12px;
    height: 12px;
    stroke-width: 3;
  }
  .errors figcaption {
    flex-wrap: wrap;
    margin-bottom: var(--cager-space-1);
  }
  .errors .scale {
    margin-left: auto;
  }
  .errors .area {
    position: relative;
    height: 120px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
  }
  @media (max-width: 640px) {
    .kinds {
      grid-template-columns: 1fr;
    }
    .page > .card {
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
