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
    /* What follows the weight in a shorthand of the font. */
    --cager-text-small: var(--cager-size-small) / 1.45 var(--cager-font);
    --cager-text-large: var(--cager-size-large) / 1.45 var(--cager-font);
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
