import { css } from 'lit';

/**
 * Looks that all components share, in one sheet that each of them adopts: plain elements, and classes for what occurs in several places. Expects
 * the tokens of the page.
 */
export const controls = css`
  :host {
    font: var(--cager-size) / 1.45 var(--cager-font);
    color: var(--cager-text);
    accent-color: var(--cager-accent);
  }
  *,
  *::before,
  *::after {
    box-sizing: border-box;
  }
  [hidden] {
    display: none !important;
  }
  :is(h1, h2, h3, h4, p, ul, ol, dl, dd, figure, fieldset) {
    margin: 0;
    padding: 0;
    list-style: none;
  }
  :is(h3, h4) {
    font-size: inherit;
  }
  h2 {
    font-size: var(--cager-size-large);
    overflow-wrap: anywhere;
  }
  :is(button, input, select) {
    font: inherit;
    color: inherit;
  }
  button,
  .button {
    display: inline-flex;
    align-items: center;
    justify-content: center;
    gap: var(--cager-space-2);
    min-height: var(--cager-control);
    padding: 0 var(--cager-space-3);
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius);
    background: var(--cager-raised);
    text-decoration: none;
    white-space: nowrap;
    cursor: pointer;
    transition: var(--cager-fast);
    transition-property: background, border-color, color;
  }
  button:hover:not(:disabled),
  .button:hover {
    background: var(--cager-hover);
  }
  button:disabled {
    opacity: 0.45;
    cursor: default;
  }
  button.primary,
  .button.primary {
    border-color: transparent;
    background: var(--cager-accent);
    color: var(--cager-on-accent);
    font-weight: 600;
  }
  button.primary:hover:not(:disabled),
  .button.primary:hover {
    background: color-mix(in srgb, var(--cager-accent) 86%, var(--cager-text));
  }
  button.danger {
    border-color: transparent;
    background: var(--cager-bad);
    color: light-dark(#ffffff, #2b0508);
    font-weight: 600;
  }
  button.quiet {
    border-color: transparent;
    background: transparent;
  }
  button.icon {
    width: var(--cager-control);
    padding: 0;
  }
  button[aria-pressed='true'] {
    border-color: transparent;
    background: var(--cager-accent-soft);
    color: var(--cager-accent);
  }
  .button.back {
    width: 36px;
    min-height: 36px;
    padding: 0;
    border-radius: 50%;
    color: var(--cager-text);
  }
  input:not([type='checkbox'], [type='radio'], [type='range'], [type='file']),
  select {
    min-height: var(--cager-control);
    padding: 0 var(--cager-space-3);
    border: 1px solid var(--cager-line-strong);
    border-radius: var(--cager-radius);
    background: var(--cager-surface);
  }
  progress {
    display: block;
    border: 0;
    border-radius: 4px;
    overflow: hidden;
    appearance: none;
    background: var(--cager-line);
  }
  progress::-webkit-progress-bar {
    background: var(--cager-line);
  }
  progress::-webkit-progress-value {
    background: var(--cager-accent);
    transition: width var(--cager-slow);
  }
  progress::-moz-progress-bar {
    background: var(--cager-accent);
  }
  a {
    color: var(--cager-accent);
  }
  summary {
    cursor: pointer;
  }
  table {
    border-collapse: collapse;
  }
  th {
    color: var(--cager-muted);
    text-align: left;
  }
  kbd {
    display: inline-block;
    min-width: 24px;
    padding: 1px 6px;
    border: 1px solid var(--cager-line);
    border-bottom-width: 2px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
    color: var(--cager-text);
    font: 12px var(--cager-mono);
    text-align: center;
    white-space: nowrap;
  }
  dialog {
    max-width: min(880px, calc(100vw - 24px));
    max-height: calc(100dvh - 24px);
    padding: var(--cager-space-5);
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
    color: var(--cager-text);
    box-shadow: var(--cager-shadow);
  }
  dialog header {
    display: flex;
    justify-content: space-between;
    align-items: center;
    margin-bottom: var(--cager-space-3);
  }
  dialog header h2 {
    margin: 0;
  }
  dialog::backdrop {
    background: rgb(0 0 0 / 0.45);
  }
  dialog h2 {
    margin-bottom: var(--cager-space-3);
    font-size: 19px;
  }
  :focus-visible {
    outline: 2px solid var(--cager-accent);
    outline-offset: 2px;
  }
  svg.glyph {
    width: 18px;
    height: 18px;
    flex: none;
    fill: none;
    stroke: currentColor;
    stroke-width: 1.75;
    stroke-linecap: round;
    stroke-linejoin: round;
  }

  /* Text. */
  .figures {
    font-variant-numeric: tabular-nums;
  }
  .muted {
    color: var(--cager-muted);
  }
  .fine {
    color: var(--cager-muted);
    font-size: var(--cager-size-small);
  }
  .heading {
    font: 650 15px/1.3 var(--cager-font);
  }
  .clip {
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .visually-hidden {
    position: absolute;
    width: 1px;
    height: 1px;
    overflow: hidden;
    clip-path: inset(50%);
    white-space: nowrap;
  }

  /* Places: beside each other, and what takes the room that is left. */
  :is(.row, .spread, .buttons) {
    display: flex;
    align-items: center;
    gap: var(--cager-space-2);
  }
  .spread {
    justify-content: space-between;
  }
  .buttons {
    flex-wrap: wrap;
  }
  .grow {
    flex: 1;
    min-width: 0;
  }

  /* Fades at an end behind which there is more. */
  .scrolls {
    animation: ends linear;
    animation-timeline: scroll(self);
  }
  @keyframes ends {
    from {
      mask: linear-gradient(#000 calc(100% - 44px), transparent);
    }
    1%,
    99% {
      mask: linear-gradient(transparent, #000 44px calc(100% - 44px), transparent);
    }
    to {
      mask: linear-gradient(transparent, #000 44px);
    }
  }

  /* Boxes. */
  :is(.card, .glass) {
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
  }
  .glass {
    border-color: color-mix(in srgb, var(--cager-line) 75%, transparent);
    background: var(--cager-glass);
    box-shadow: var(--cager-shadow);
    backdrop-filter: blur(14px) saturate(1.3);
  }
  :is(.notice, .note) {
    display: flex;
    gap: var(--cager-space-2);
  }
  :is(.notice, .note.bad) {
    padding: var(--cager-space-3) var(--cager-space-4);
    border-radius: var(--cager-radius);
    background: var(--cager-bad-soft);
  }
  :is(.notice, .note.bad) svg {
    color: var(--cager-bad);
  }
  .field {
    display: grid;
    align-content: start;
    gap: var(--cager-space-1);
  }
  .field label {
    font: 600 var(--cager-text-small);
  }
  .tip {
    position: absolute;
    bottom: calc(100% + 2px);
    padding: 3px 8px;
    border-radius: var(--cager-radius-small);
    background: var(--cager-text);
    color: var(--cager-background);
    font-size: var(--cager-size-small);
    white-space: nowrap;
    translate: -50% 0;
    pointer-events: none;
    z-index: 3;
  }

  /* Choices of which one is taken: buttons, or labels around radio buttons. */
  .segments {
    display: flex;
    gap: 2px;
    padding: 2px;
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius);
    background: var(--cager-surface);
  }
  .segments > :is(button, label) {
    flex: 1 1 auto;
    min-height: calc(var(--cager-control) - 6px);
    border-color: transparent;
    border-radius: 6px;
    background: transparent;
  }
  .segments > :is([aria-pressed='true'], :has(:checked)) {
    background: var(--cager-accent-soft);
    color: var(--cager-accent);
    font-weight: 600;
  }

  /* Colours of the errors: root mean square, largest. */
  .key {
    display: block;
    width: 12px;
    height: 3px;
    border-radius: 2px;
    background: var(--cager-accent);
  }
  .key.linf {
    background: var(--cager-cage);
  }

  /* Names and values. */
  .pairs {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: 3px var(--cager-space-3);
    font-variant-numeric: tabular-nums;
  }
  .keys {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 5px var(--cager-space-3);
    align-items: baseline;
    font-size: 13px;
  }
  .pairs dt {
    color: var(--cager-muted);
  }
  .pairs dd {
    text-align: right;
  }
  @media (pointer: coarse) {
    :host {
      --cager-control: 42px;
    }
  }
  @media (prefers-contrast: more) {
    .glass {
      border-width: 2px;
    }
  }
`;

/** A page that scrolls, beside the viewer, which fills its own. */
export const pageLayout = css`
  :host {
    display: block;
    flex: 1;
    min-height: 0;
    overflow: auto;
    background: var(--cager-background);
  }
  .page {
    margin: 0 auto;
    padding: var(--cager-space-6) var(--cager-space-5) var(--cager-space-7);
  }
  header {
    display: flex;
    align-items: center;
    gap: var(--cager-space-3);
  }
  h1 {
    font-size: var(--cager-size-title);
    line-height: 1.2;
    letter-spacing: -0.01em;
  }
  @media (max-width: 860px) {
    .page {
      padding: var(--cager-space-4) var(--cager-space-3) var(--cager-space-6);
    }
  }
`;
