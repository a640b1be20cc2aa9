import { html, type TemplateResult } from 'lit';

/** What stands at the end of a report, and how its views are moved. */
export function footer(origin: TemplateResult) {
  return html`<footer>
    <p>
      Drag a view to turn all of its group, with the right button to move it; click it and turn the wheel, or pinch, to
      zoom. Drag across a chart to zoom in, double-click to see all of it, and click a name below it to hide a series.
    </p>
    <p>${origin}</p>
  </footer>`;
}
