import { css } from 'lit';

/** The viewer in small places, under fingers, and for those who want more contrast or less motion. Comes after `viewerStyle`. */
export const viewerSizesStyle = css`
  @container (max-width: 680px) {
    .errors,
    .transport .wide {
      display: none;
    }
    .title p .more {
      display: none;
    }
    .place {
      margin-left: auto;
      padding-right: var(--cager-space-2);
    }
    .deck {
      left: var(--cager-space-2);
      right: var(--cager-space-2);
      bottom: max(var(--cager-space-2), env(safe-area-inset-bottom));
    }
    .spacer {
      display: none;
    }
  }
  @container (max-width: 400px) {
    .clock {
      display: none;
    }
  }
  @container (max-width: 320px) or (max-height: 220px) {
    .tools,
    .title,
    .legend,
    .place,
    .transport select,
    .transport button:not(.play) {
      display: none;
    }
    .deck {
      left: 4px;
      right: 4px;
      bottom: 4px;
      display: flex;
      align-items: center;
      padding: 2px 4px;
    }
    .deck cager-timeline {
      flex: 1;
      min-width: 0;
    }
    .transport .play {
      width: 28px;
      height: 28px;
      min-width: 0;
      padding: 0;
    }
    .transport .play svg {
      width: 16px;
      height: 16px;
    }
  }
  @media (pointer: coarse) {
    [data-action='help'] {
      display: none;
    }
  }
  @container (max-width: 680px) and (max-height: 700px) {
    .tools button {
      min-height: 36px;
    }
  }
  @media (prefers-contrast: more) {
    .glass {
      border-width: 2px;
    }
  }
  @media (prefers-reduced-motion: reduce) {
    .live::before {
      animation: none !important;
    }
  }
`;
