import { css } from 'lit';

/** Looks of the list on narrow screens: a card for each session, in place of the table's rows. */
export const cardsStyle = css`
  @media (max-width: 860px) {
    thead {
      position: absolute;
      display: block;
      /* Its columns would make the page as wide as they are. */
      width: 1px;
      height: 1px;
      overflow: hidden;
      clip-path: inset(50%);
    }
    :is(table, tbody, .more, .more td) {
      display: block;
    }
    .session {
      display: flex;
      flex-wrap: wrap;
      align-items: start;
      gap: 3px var(--cager-space-4);
      padding: var(--cager-space-3) var(--cager-space-4);
    }
    .session td {
      order: 1;
      padding: 0;
      text-align: left;
      font-size: var(--cager-size-small);
    }
    .session td.title {
      order: 0;
      flex: 1 1 100%;
      min-width: 0;
      font-size: var(--cager-size);
    }
    .name {
      max-width: none;
    }
    .session td.tools {
      order: 2;
      margin: -6px -8px -6px auto;
    }
    .session td:empty {
      display: none;
    }
    .session td[data-label]::before {
      content: attr(data-label) ' ';
      color: var(--cager-muted);
    }
    .more td {
      padding: 0 var(--cager-space-4) var(--cager-space-4);
    }
    .search {
      max-width: none;
      flex-basis: 100%;
    }
    .bar .segments {
      flex: 1;
    }
    .ways li {
      padding: var(--cager-space-4);
    }
  }
`;
