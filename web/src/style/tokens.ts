import { css } from 'lit';

/**
 * Design tokens as custom properties: colours for dark and light, spacing, type, radii, motion. A page that embeds a component can override any of
 * them on the element. `data-theme="dark"` or `"light"` on the root element overrides what the system prefers.
 */
export const tokens = css`
  :root,
  :host {
    color-scheme: dark light;
    /* Surfaces, from the backdrop of the picture to what floats above it. */
    --cager-stage-top: light-dark(#f6f8fa, #363d47);
    --cager-stage: light-dark(#d9dfe7, #15191e);
    --cager-background: light-dark(#f5f6f8, #0f1215);
    --cager-surface: light-dark(#ffffff, #181c21);
    --cager-raised: light-dark(#f0f2f5, #21262d);
    --cager-hover: light-dark(#e5e9ee, #2b313a);
    --cager-glass: light-dark(rgb(255 255 255 / 0.82), rgb(20 24 29 / 0.78));
    --cager-line: light-dark(#d7dce3, #2d343d);
    --cager-line-strong: light-dark(#818c99, #68737f);
    /* Text. */
    --cager-text: light-dark(#15191e, #eceff3);
    --cager-muted: light-dark(#56606c, #a3adb8);
    /* Meaning: what can be acted on, what is on, what is wrong. */
    --cager-accent: light-dark(#0a61cf, #6cabff);
    --cager-on-accent: light-dark(#ffffff, #07182e);
    --cager-accent-soft: light-dark(rgb(10 97 207 / 0.12), rgb(108 171 255 / 0.17));
    --cager-cage: light-dark(#b35a00, #ffb454);
    --cager-good: light-dark(#14713a, #55cd86);
    --cager-warning: light-dark(#8a5600, #f3bd4e);
    --cager-bad: light-dark(#bb1f2c, #ff7e83);
    --cager-bad-soft: light-dark(rgb(187 31 44 / 0.09), rgb(255 126 131 / 0.14));
    --cager-live: light-dark(#c81e3a, #ff5d6c);
    /* What is drawn in the picture. */
    --cager-model: light-dark(#ece6de, #d2cbc2);
    --cager-wire: light-dark(#1b2430, #0b0f14);
    --cager-handle: light-dark(#c2185b, #ff6fa8);
    --cager-grid: light-dark(#566273, #93a1b3);
    --cager-shadow-strength: 0.62;
    /* Measures. */
    --cager-space-1: 4px;
    --cager-space-2: 8px;
    --cager-space-3: 12px;
    --cager-space-4: 16px;
    --cager-space-5: 24px;
    --cager-space-6: 32px;
    --cager-space-7: 48px;
    --cager-radius-small: 5px;
    --cager-radius: 8px;
    --cager-radius-large: 14px;
    --cager-control: 34px;
    --cager-shadow: 0 1px 2px rgb(0 0 0 / 0.12), 0 8px 28px light-dark(rgb(20 30 45 / 0.14), rgb(0 0 0 / 0.42));
    /* Type. */
    --cager-font: 'Inter', 'Segoe UI', system-ui, -apple-system, 'Helvetica Neue', 'Liberation Sans', Arial, sans-serif;
    --cager-mono: ui-monospace, 'SF Mono', 'Cascadia Mono', 'DejaVu Sans Mono', Menlo, Consolas, monospace;
    --cager-size-small: 12px;
    --cager-size: 14px;
    --cager-size-large: 17px;
    --cager-size-title: 24px;
    /* Motion. */
    --cager-fast: 120ms;
    --cager-slow: 260ms;
  }
  :root[data-theme='dark'],
  :host([theme='dark']) {
    color-scheme: dark;
  }
  :root[data-theme='light'],
  :host([theme='light']) {
    color-scheme: light;
  }
  @media (prefers-contrast: more) {
    :root,
    :host {
      --cager-background: light-dark(#ffffff, #000000);
      --cager-surface: light-dark(#ffffff, #000000);
      --cager-raised: light-dark(#ffffff, #0a0a0a);
      --cager-glass: light-dark(#ffffff, #000000);
      --cager-line: light-dark(#3c444d, #b4bdc8);
      --cager-line-strong: light-dark(#000000, #ffffff);
      --cager-text: light-dark(#000000, #ffffff);
      --cager-muted: light-dark(#1f252c, #e2e6ea);
      --cager-accent: light-dark(#003f94, #9cc7ff);
    }
  }
  @media (prefers-reduced-motion: reduce) {
    :root,
    :host {
      --cager-fast: 0ms;
      --cager-slow: 0ms;
    }
  }
`;

/** Looks of plain HTML controls inside a component: buttons, fields, links, focus rings, tables' figures. Expects {@link tokens}. */
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
  button,
  input,
  select,
  textarea {
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
    transition:
      background var(--cager-fast),
      border-color var(--cager-fast),
      color var(--cager-fast);
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
  input:not([type='checkbox'], [type='radio'], [type='range'], [type='file']),
  select,
  textarea {
    min-height: var(--cager-control);
    padding: 0 var(--cager-space-3);
    border: 1px solid var(--cager-line-strong);
    border-radius: var(--cager-radius);
    background: var(--cager-surface);
  }
  a {
    color: var(--cager-accent);
  }
  :focus-visible {
    outline: 2px solid var(--cager-accent);
    outline-offset: 2px;
  }
  .figures {
    font-variant-numeric: tabular-nums;
  }
  .muted {
    color: var(--cager-muted);
  }
  .visually-hidden {
    position: absolute;
    width: 1px;
    height: 1px;
    overflow: hidden;
    clip-path: inset(50%);
    white-space: nowrap;
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
  @media (pointer: coarse) {
    :host {
      --cager-control: 42px;
    }
  }
`;

/** The document's own style, for the page around the components. */
export const page = css`
  html,
  body {
    height: 100%;
    margin: 0;
    background: var(--cager-background);
    color: var(--cager-text);
    font: var(--cager-size) / 1.45 var(--cager-font);
    -webkit-text-size-adjust: 100%;
  }
  body {
    display: flex;
    flex-direction: column;
  }
`;
