import { html, type TemplateResult } from 'lit';
import type { Method } from './data';
import { methodColor } from './methods';

type Cell = string | TemplateResult;

/** A table whose first `words` columns hold words, the others figures. */
export function table(
  headers: readonly Cell[],
  words: number,
  rows: readonly (readonly Cell[])[],
  quietRows: readonly (readonly Cell[])[] = [],
) {
  const kind = (k: number) => (k < words ? 'words' : 'figures');
  const row = (cells: readonly Cell[], name: string) =>
    html`<tr class=${name}>
      ${cells.map((cell, k) => html`<td class=${kind(k)}>${cell}</td>`)}
    </tr>`;
  return html`<div class="wide" tabindex="0" role="region" aria-label="Table">
    <table>
      <thead ?hidden=${headers.every((header) => header === '')}>
        <tr>
          ${headers.map((header, k) => html`<th class=${kind(k)} scope="col">${header}</th>`)}
        </tr>
      </thead>
      <tbody>
        ${rows.map((cells) => row(cells, ''))} ${quietRows.map((cells) => row(cells, 'quiet'))}
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

/** A name with the colour that it has in all charts. */
export function colored(color: string, name: string) {
  return html`<i class="dot" .style=${`background:${color}`}></i>${name}`;
}

export function methodName(method: Method) {
  return colored(methodColor(method), method.name);
}

/** What stands below charts, views and tables: what is shown, how to read it, and the paper's figure. */
export function caption(what: string, reading: string, paper: string) {
  return html`<p class="caption"><b>${what}</b> ${reading} <i>${paper}</i></p>`;
}

/** A legend of a colour map. */
export function colorScale(low: string, high: string, gradient: string) {
  return html`<div class="scale figures">${low}<i .style=${`background:${gradient}`}></i>${high}</div>`;
}
