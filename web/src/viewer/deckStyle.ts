import { css } from 'lit';

/** The deck below the picture, and what small pictures leave out. */
export const deckStyle = css`
  .deck {
    position: absolute;
    inset: auto var(--cager-space-3) var(--cager-space-3);
    padding: var(--cager-space-2) var(--cager-space-2) 2px;
  }
  .transport {
    gap: 2px;
    min-width: 0;
  }
  .play {
    width: 42px;
    height: 42px;
    padding: 0;
    margin: 0 4px;
    border-radius: 50%;
  }
  .play svg {
    width: 22px;
    height: 22px;
  }
  .transport select {
    field-sizing: content;
    padding: 0 2px 0 8px;
    border-color: transparent;
    background: transparent;
    cursor: pointer;
  }
  .transport select:hover {
    background: var(--cager-hover);
  }
  .transport option {
    background: var(--cager-surface);
    color: var(--cager-text);
  }
  .place {
    gap: var(--cager-space-3);
    margin-left: var(--cager-space-2);
    white-space: nowrap;
  }
  [data-place] {
    font-weight: 600;
  }
  .rate {
    padding-right: var(--cager-space-2);
    white-space: nowrap;
  }
  .errors {
    margin-left: auto;
    gap: var(--cager-space-4);
    padding: 0 var(--cager-space-3);
    font-size: var(--cager-size-small);
    white-space: nowrap;
  }
  .errors dt {
    color: var(--cager-muted);
  }
  .errors dd {
    min-width: 4.2em;
  }
  @container (max-width: 680px) {
    :is(.title .more, .caption p:has(+ p), .caption .up span) {
      display: none;
    }
    .up {
      margin-left: 4px;
    }
    .transport {
      flex-wrap: wrap;
    }
    .transport::after {
      content: '';
      order: 1;
      flex-basis: 100%;
    }
    .errors {
      order: 2;
    }
    .place {
      margin-left: auto;
      padding-right: var(--cager-space-2);
    }
    .deck {
      inset: auto var(--cager-space-2) max(var(--cager-space-2), env(safe-area-inset-bottom));
    }
    .tools button {
      min-height: 38px;
    }
  }
  @container (max-width: 680px) and (max-height: 700px) {
    .tools button {
      min-height: 36px;
    }
  }
  @container (max-width: 480px) {
    .transport :is(.clock, [data-action='in'], [data-action='out']) {
      order: 2;
    }
    .transport .icon {
      width: 38px;
      padding: 0;
    }
    .transport select {
      padding: 0;
    }
    .transport .rate {
      display: none;
    }
    .place {
      display: contents;
    }
    [data-place] {
      margin-left: auto;
      padding-right: 4px;
      font-size: var(--cager-size-small);
    }
    /* Beside the others, however long its figures are. */
    .errors {
      flex: 1 1 0;
      justify-content: end;
      min-width: 0;
      overflow: hidden;
      padding: 0;
    }
    :is(.errors, .errors .row) {
      gap: 3px;
    }
    .errors .row + .row {
      margin-left: 6px;
    }
    .errors dd {
      min-width: 0;
    }
    .errors .key {
      width: 6px;
    }
  }
  @container (max-width: 320px) or (max-height: 220px) {
    :is(.tools, .title, .legend, .errors, .place, .transport select, .transport button:not(.play)) {
      display: none;
    }
    .deck {
      inset: auto 4px 4px;
      display: flex;
      align-items: center;
      padding: 2px 4px;
    }
    cager-timeline {
      flex: 1;
      min-width: 0;
    }
    .play {
      width: 28px;
      height: 28px;
      min-height: 0;
    }
    .play svg {
      width: 16px;
      height: 16px;
    }
  }
  @media (pointer: coarse) {
    .sheet .keyboard {
      display: none;
    }
  }
`;
