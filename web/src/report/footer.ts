import { html, type TemplateResult } from 'lit';

/** What stands at the end of a report, and how its views are moved. */
export function footer(origin: TemplateResult) {
  return html`<footer>
    <p>
      Drag a view to orbit its whole group, drag with the right button to pan; click it and scroll, or pinch, to zoom.
      Drag across a chart to zoom in, double-click to zoom out, and click a name below it to hide a series.
    </p>
    <p>${origin}</p>
  </footer>`;
}
