import { html, svg, type TemplateResult } from 'lit';

/** Line drawings on a field of 24 × 24. */
const DRAWINGS = {
  play: svg`<path d="M8 5.5v13l10.5-6.5z" fill="currentColor"/>`,
  pause: svg`<path d="M8.5 6v12M15.5 6v12" stroke-width="3.4"/>`,
  previous: svg`<path d="M17 6.5v11L9.5 12z" fill="currentColor"/><path d="M6.5 6.5v11"/>`,
  next: svg`<path d="M7 6.5v11l7.5-5.5z" fill="currentColor"/><path d="M17.5 6.5v11"/>`,
  loop: svg`<path d="M5 11.5V10a3 3 0 0 1 3-3h10M15.5 4.5 18 7l-2.5 2.5M19 12.5V14a3 3 0 0 1-3 3H6M8.5 19.5 6 17l2.5-2.5"/>`,
  pingPong: svg`<path d="M4 12h16M8 8l-4 4 4 4M16 8l4 4-4 4"/>`,
  in: svg`<path d="M12 5H7v14h5"/><path d="M11 12h8"/>`,
  out: svg`<path d="M12 5h5v14h-5"/><path d="M13 12H5"/>`,
  worst: svg`<path d="M4 18.5 9 12l3.5 3L17 7.5l3 4"/><circle cx="17" cy="6.5" r="2.4" fill="currentColor" stroke="none"/>`,
  model: svg`<path d="M12 3.5c4.7 0 8.5 3.8 8.5 8.5s-3.8 8.5-8.5 8.5S3.5 16.7 3.5 12 7.3 3.5 12 3.5z"/><path d="M8 8.5c1-1.5 2.3-2.2 4-2.3"/><path d="M12 20.5c3.5-1.5 6-4.5 6.5-8.5" opacity=".45"/>`,
  wireframe: svg`<path d="M12 3.5 20 8v8l-8 4.5L4 16V8zM4 8l8 4.5L20 8M12 12.5v8M4 16l8-3.5 8 3.5M12 3.5v9"/>`,
  points: svg`<g fill="currentColor" stroke="none"><circle cx="6" cy="7" r="1.6"/><circle cx="12" cy="5" r="1.6"/><circle cx="18" cy="8" r="1.6"/><circle cx="8.5" cy="12.5" r="1.6"/><circle cx="15" cy="12.5" r="1.6"/><circle cx="6" cy="18" r="1.6"/><circle cx="12" cy="18.5" r="1.6"/><circle cx="18.5" cy="17" r="1.6"/></g>`,
  cage: svg`<path d="M12 3 20 7.5v9L12 21l-8-4.5v-9z"/><path d="M4 7.5 12 12l8-4.5M12 12v9"/><g fill="currentColor" stroke="none"><circle cx="12" cy="3" r="1.7"/><circle cx="20" cy="7.5" r="1.7"/><circle cx="20" cy="16.5" r="1.7"/><circle cx="12" cy="21" r="1.7"/><circle cx="4" cy="16.5" r="1.7"/><circle cx="4" cy="7.5" r="1.7"/></g>`,
  handles: svg`<circle cx="12" cy="12" r="2.6" fill="currentColor"/><circle cx="12" cy="12" r="6.5"/><path d="M12 2.5v3M12 18.5v3M2.5 12h3M18.5 12h3"/>`,
  ground: svg`<path d="M3 17.5 8 9h8l5 8.5zM5.6 13h12.8M10.5 9 9 17.5M13.5 9l1.5 8.5"/>`,
  colors: svg`<path d="M12 3.5a8.5 8.5 0 0 0 0 17c1.3 0 1.9-.9 1.6-2-.4-1.5.4-2.7 2-2.7h2.2c1.7 0 2.7-1.3 2.7-3.3C20.5 7.3 16.7 3.5 12 3.5z"/><g fill="currentColor" stroke="none"><circle cx="7.4" cy="12.6" r="1.4"/><circle cx="9.6" cy="8.3" r="1.4"/><circle cx="14.2" cy="7.6" r="1.4"/><circle cx="17" cy="11.2" r="1.4"/></g>`,
  materials: svg`<circle cx="12" cy="12" r="8.5"/><path d="M12 3.5v17M3.5 12h17" opacity=".45"/><path d="M12 3.5a8.500 8.500 0 0 1 8.500 8.500H12zM12 20.500A8.500 8.500 0 0 1 3.500 12H12z" fill="currentColor" stroke="none"/>`,
  parts: svg`<path d="m12 3.500 8.500 4.500-8.500 4.500L3.500 8z"/><path d="m3.500 12 8.500 4.500 8.500-4.500M3.500 16l8.500 4.500 8.500-4.500"/>`,
  eye: svg`<path d="M2.500 12c2.300-4.200 5.600-6.300 9.500-6.300s7.200 2.100 9.500 6.300c-2.300 4.200-5.600 6.300-9.500 6.300S4.800 16.200 2.500 12z"/><circle cx="12" cy="12" r="2.800"/>`,
  eyeOff: svg`<path d="M5.500 8.200C4.400 9.200 3.400 10.500 2.500 12c2.300 4.200 5.600 6.300 9.500 6.300 1.600 0 3-.3 4.300-1M9.500 6c.8-.2 1.600-.3 2.500-.3 3.900 0 7.200 2.100 9.500 6.300-.7 1.300-1.500 2.400-2.400 3.300M4 4l16 16"/>`,
  heat: svg`<path d="M12 3.5c1 3.5 5.5 5.5 5.5 10.5a5.5 5.5 0 0 1-11 0c0-2 .8-3.3 2-4.5.2 1.5.8 2.3 1.7 2.7C10 9 10.5 6 12 3.5z"/>`,
  frame: svg`<path d="M4 8.5V5.5A1.5 1.5 0 0 1 5.5 4h3M15.5 4h3A1.5 1.5 0 0 1 20 5.5v3M20 15.5v3a1.5 1.5 0 0 1-1.5 1.5h-3M8.5 20h-3A1.5 1.5 0 0 1 4 18.5v-3"/><circle cx="12" cy="12" r="3.3"/>`,
  follow: svg`<circle cx="12" cy="12" r="2.6" fill="currentColor"/><path d="M3.5 12h4M16.500 12h4M5.800 9.500 3.500 12l2.300 2.500M18.200 9.500l2.300 2.500-2.300 2.500"/><path d="M8 5.500c2.500-1.300 5.500-1.300 8 0M8 18.500c2.500 1.300 5.500 1.300 8 0" opacity=".55"/>`,
  camera: svg`<path d="M4 8.5A1.5 1.5 0 0 1 5.5 7H8l1.5-2.5h5L16 7h2.5A1.5 1.5 0 0 1 20 8.5v9a1.5 1.5 0 0 1-1.5 1.5h-13A1.5 1.5 0 0 1 4 17.5z"/><circle cx="12" cy="13" r="3.5"/>`,
  turntable: svg`<ellipse cx="12" cy="16" rx="8.5" ry="3.5"/><path d="M12 4v8M9.5 6.5 12 4l2.5 2.5"/><path d="m14 21.2-2.3-1.7 2.3-1.8"/>`,
  figures: svg`<path d="M5 20V11M10 20V5M15 20v-6M20 20V8"/>`,
  help: svg`<circle cx="12" cy="12" r="8.5"/><path d="M9.500 9.800a2.500 2.500 0 1 1 3.700 2.200c-.8.500-1.200 1-1.200 1.900M12 16.700v.1"/>`,
  views: svg`<path d="M5 5.500h14v13H5z"/><path d="M12 5.500v13M5 12h14"/>`,
  link: svg`<path d="M10 14a3.500 3.500 0 0 0 5 0l3.500-3.500a3.540 3.540 0 0 0-5-5L12 7M14 10a3.500 3.500 0 0 0-5 0l-3.500 3.500a3.540 3.540 0 0 0 5 5L12 17"/>`,
  fullscreen: svg`<path d="M9 4H4v5M15 4h5v5M20 15v5h-5M4 15v5h5"/>`,
  beside: svg`<rect x="3.5" y="5" width="7.5" height="14" rx="1.5"/><rect x="13" y="5" width="7.5" height="14" rx="1.5"/><path d="M5.800 14.500 7.300 10l1.500 4.500zM15.300 14.500l1.500-4.500 1.500 4.500z"/>`,
  poses: svg`<path d="M12 4 20 18.5H4z"/><circle cx="12" cy="13" r="2.2" fill="currentColor" stroke="none"/>`,
  edit: svg`<path d="M4.500 17.500 12 4.500l7.500 13z"/><path d="M12 11.500v7M12 11.500l-2 2.500M12 11.500l2 2.500" opacity=".55"/><g fill="currentColor" stroke="none"><circle cx="12" cy="4.500" r="2.400"/><circle cx="4.500" cy="17.500" r="2"/><circle cx="19.500" cy="17.500" r="2"/></g>`,
  close: svg`<path d="m6 6 12 12M18 6 6 18"/>`,
  file: svg`<path d="M13 3.5H7A1.5 1.5 0 0 0 5.5 5v14A1.5 1.5 0 0 0 7 20.5h10a1.5 1.5 0 0 0 1.5-1.5V9zM13 3.5V9h5.5"/>`,
  search: svg`<circle cx="11" cy="11" r="6.5"/><path d="m16 16 4.5 4.5"/>`,
  upload: svg`<path d="M12 16V4m0 0L7 9m5-5 5 5M4 16v4h16v-4"/>`,
  download: svg`<path d="M12 4v12m0 0 5-5m-5 5-5-5M4 17v3h16v-3"/>`,
  pencil: svg`<path d="m4 20 1-5L16 4l4 4L9 19zM13.500 6.500l4 4"/>`,
  trash: svg`<path d="M4 7h16M9 7V4h6v3M6 7l1 13h10l1-13M10 11v5M14 11v5"/>`,
  alert: svg`<circle cx="12" cy="12" r="8.5"/><path d="M12 7.5v5.5M12 16.2v.3"/>`,
  copy: svg`<rect x="9" y="9" width="11" height="11" rx="2"/><path d="M15 9V4H4v11h5"/>`,
  check: svg`<path d="m5 12.5 4.5 4.5L19 7"/>`,
  back: svg`<path d="M14.5 6 8.5 12l6 6"/>`,
  undo: svg`<path d="M8.5 5 4.500 9l4 4M5 9h9a5.500 5.500 0 0 1 0 11h-4"/>`,
  redo: svg`<path d="m15.500 5 4 4-4 4M19 9h-9a5.500 5.500 0 0 0 0 11h4"/>`,
  reset: svg`<path d="M4.500 12a7.500 7.500 0 1 0 2.400-5.500M4.500 4.500v4h4M12 8.500v4l2.500 1.500"/>`,
};

export type GlyphName = keyof typeof DRAWINGS;

/** Drawings beside or instead of a text; screen readers pass over them, a button that has nothing else has a label. */
export const glyphs = Object.fromEntries(
  Object.entries(DRAWINGS).map(([name, drawing]) => [
    name,
    html`<svg class="glyph" viewBox="0 0 24 24" aria-hidden="true">${drawing}</svg>`,
  ]),
) as Readonly<Record<GlyphName, TemplateResult>>;
