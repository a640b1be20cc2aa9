import { html, svg, type TemplateResult } from 'lit';

const DRAWINGS = {
  undo: svg`<path d="M8.5 5 4.500 9l4 4M5 9h9a5.500 5.500 0 0 1 0 11h-4" />`,
  redo: svg`<path d="m15.500 5 4 4-4 4M19 9h-9a5.500 5.500 0 0 0 0 11h4" />`,
  reset: svg`<path d="M4.500 12a7.500 7.500 0 1 0 2.400-5.500M4.500 4.500v4h4M12 8.500v4l2.500 1.500" />`,
  remove: svg`<path d="M5 7h14M9.500 7V4.500h5V7M7 7l.8 12.500h8.400L17 7M10.500 10.500v5.500M13.500 10.500v5.500" />`,
  save: svg`<path d="M12 4v11m0 0 4.500-4.500M12 15l-4.500-4.500M4.500 17v3h15v-3" />`,
};

/** A drawing in a button of the editor, on a field of 24 × 24; screen readers pass over it. */
export function drawing(name: keyof typeof DRAWINGS): TemplateResult {
  return html`<svg class="glyph" viewBox="0 0 24 24" aria-hidden="true">${DRAWINGS[name]}</svg>`;
}
