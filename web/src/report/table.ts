import { html, type TemplateResult } from 'lit';
import type { ChartOptions } from '../charts/chart';
import type { Method } from './data';
import { methodColor } from './methods';
import type { Moments, View } from './views';

export type Cell = string | TemplateResult;
/** A column: its title, and what it has for a row. */
export type Column<T> = readonly [title: Cell, cell: (row: T) => Cell];

/**
 * A table: a column holds words where `words` more of them follow, else figures.
 *
 * @param words how many columns hold words, from the left
 * @param quiet rows at the end that are there to compare with
 */
export function table<T>(rows: readonly T[], columns: readonly Column<T>[], words = 1, quiet: readonly T[] = []) {
  const kind = (k: number) => (k < words ? 'words' : 'figures');
  const row = (of: T, name: string) =>
    html`<tr class=${name}>
      ${columns.map(([, cell], k) => html`<td class=${kind(k)}>${cell(of)}</td>`)}
    </tr>`;
  return html`<div class="wide" tabindex="0" role="region" aria-label="Table">
    <table>
      <thead ?hidden=${columns.every(([title]) => title === '')}>
        <tr>
          ${columns.map(([title], k) => html`<th class=${kind(k)} scope="col">${title}</th>`)}
        </tr>
      </thead>
      <tbody>
        ${rows.map((of) => row(of, ''))} ${quiet.map((of) => row(of, 'quiet'))}
      </tbody>
    </table>
  </div>`;
}

/** The same, behind a line that opens it. */
export function folded(title: string, content: TemplateResult) {
  return html`<details>
    <summary>${title}</summary>
    ${content}
  </details>`;
}

export function charts(...all: readonly ChartOptions[]) {
  return html`<div class="charts">${all.map((options) => html`<cager-chart .options=${options}></cager-chart>`)}</div>`;
}

/** Views beside each other; `look` is how large they are. */
export function viewsOf(
  label: string,
  { views, framed, moments = null }: { views: readonly View[]; framed: Float32Array; moments?: Moments | null },
  look: '' | 'wide-view' | 'large-views' = '',
) {
  return html`<report-views
    class=${look}
    .views=${views}
    .framed=${framed}
    .moments=${moments}
    label=${label}
  ></report-views>`;
}

export function colored(color: string, name: string) {
  return html`<i class="dot" .style=${`background:${color}`}></i>${name}`;
}

export function methodName(method: Method) {
  return colored(methodColor(method), method.name);
}

/** What stands below charts, views and tables: what is shown, how to read it, and the paper's figure. */
export function caption(what: string, reading: Cell, paper = '') {
  return html`<p class="caption"><b>${what}</b> ${reading} <i>${paper}</i></p>`;
}

export function colorScale(low: string, high: string, gradient: string) {
  return html`<div class="scale row fine figures">${low}<i .style=${`background:${gradient}`}></i>${high}</div>`;
}

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
