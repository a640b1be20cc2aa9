import { type SVGTemplateResult, svg, html } from 'lit';

/** A glyph of 24 × 24 units as the page's controls draw them: strokes, no fill. It says nothing to screen readers; its button does. */
function glyph(strokes: SVGTemplateResult) {
  return html`<svg class="glyph" viewBox="0 0 24 24" aria-hidden="true">${strokes}</svg>`;
}

export const search = glyph(svg`<circle cx="11" cy="11" r="6.5" /><path d="m16 16 4.5 4.5" />`);
export const upload = glyph(svg`<path d="M12 16V4m0 0L7 9m5-5 5 5M4 16v4h16v-4" />`);
export const download = glyph(svg`<path d="M12 4v12m0 0 5-5m-5 5-5-5M4 17v3h16v-3" />`);
export const trash = glyph(svg`<path d="M4 7h16M9 7V4h6v3M6 7l1 13h10l1-13M10 11v5M14 11v5" />`);
export const alert = glyph(svg`<circle cx="12" cy="12" r="8.5" /><path d="M12 7.5v5.5M12 16.2v.3" />`);
export const copy = glyph(svg`<rect x="9" y="9" width="11" height="11" rx="2" /><path d="M15 9V4H4v11h5" />`);
export const check = glyph(svg`<path d="m5 12.5 4.5 4.5L19 7" />`);
export const cross = glyph(svg`<path d="m6 6 12 12M18 6 6 18" />`);
export const play = glyph(svg`<path d="M7 4.5v15l12-7.5z" />`);
export const file = glyph(svg`<path d="M6 3h8l4 4v14H6zM14 3v4h4" />`);
export const back = glyph(svg`<path d="M14.5 6 8.5 12l6 6" />`);
