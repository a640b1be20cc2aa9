import { html, nothing, type TemplateResult } from 'lit';
import type { Session } from '../service/messages';
import { problemFrom, sentenceOf } from '../service/problem';
import type { Figures } from './figures';
import { glyphs } from '../style/glyphs';
import { FORMATS, type Format } from './download';
import * as text from '../text';
import { thumbnailOf } from './thumbnails';

export interface Row {
  readonly session: Session;
  readonly figures: Figures | null;
  /** Frames per second. */
  readonly rate: number;
  /** Seconds since 1970. */
  readonly now: number;
  /** Part of the container that has been downloaded; null while none is. */
  readonly downloaded: number | null;
  readonly onDownload: (format: Format) => void;
  readonly onRename: () => void;
  readonly onRemove: () => void;
}

export const tableHead = html`
  <thead role="rowgroup">
    <tr role="row">
      <th role="columnheader" scope="col">Session</th>
      <th role="columnheader" scope="col">State</th>
      <th role="columnheader" scope="col">Progress</th>
      <th
        role="columnheader"
        scope="col"
        class="number"
        title="RMS over all points, averaged over frames; relative to the rest pose's diagonal"
      >
        Mean error
      </th>
      <th
        role="columnheader"
        scope="col"
        class="number"
        title="Worst point of all frames; relative to the rest pose's diagonal"
      >
        Worst error
      </th>
      <th role="columnheader" scope="col" class="number">Size</th>
      <th role="columnheader" scope="col" class="number">Created</th>
      <th role="columnheader" scope="col"><span class="visually-hidden">Actions</span></th>
    </tr>
  </thead>
`;

/** Identifiers begin with the time: their ends tell them apart. */
export function nameOf(session: Session): string {
  return session.name ?? `Session ${session.id.slice(-8)}`;
}

/** The rows of one session, in a `tbody` of its own. Roles are given, since narrow screens do not lay it out as a table. */
export function row(row: Row): TemplateResult {
  const { session, figures, now } = row;
  const name = nameOf(session);
  const created = new Date(1000 * session.created);
  return html`
    <tbody role="rowgroup" data-id=${session.id}>
      <tr class="session" role="row">
        <td class="title" role="cell">
          ${thumbnail(session)}
          <a class="name clip" href="#/session/${encodeURIComponent(session.id)}" title=${name}>${name}</a>
          <div class="facts fine clip">${facts(session)}</div>
        </td>
        <td role="cell">${state(session, row.rate)}</td>
        <td role="cell">${frames(session)}</td>
        <td role="cell" class="number" data-label="Mean error">
          ${figures ? text.percent(figures.meanL2, 2) : nothing}
        </td>
        <td role="cell" class="number" data-label="Worst error">${figures ? worstError(session, figures) : nothing}</td>
        <td role="cell" class="number" data-label="Size">${sizes(session, figures)}</td>
        <td role="cell" class="number">
          <time
            datetime=${created.toISOString()}
            title=${created.toLocaleString(undefined, { dateStyle: 'medium', timeStyle: 'medium' })}
            >${text.age(session.created, now)}</time
          >
        </td>
        <td class="tools" role="cell"><div class="actions row">${download(row, name)}${change(row, name)}</div></td>
      </tr>
      ${remarks(session)}
    </tbody>
  `;
}

function thumbnail({ id }: Session) {
  const picture = thumbnailOf(id);
  return picture === null
    ? html`<span class="thumbnail">${glyphs.cage}</span>`
    : html`<img class="thumbnail" src=${picture} alt="" />`;
}

function facts(session: Session): string {
  const parts = [
    session.points === null ? null : text.counted(session.points, 'point'),
    session.cage_vertices === null ? null : `cage of ${text.count(session.cage_vertices)}`,
    session.coordinates === 'mvc' ? null : text.SYSTEM_NAMES[session.coordinates],
  ];
  return parts.filter((part) => part !== null).join(' · ');
}

function state(session: Session, rate: number): TemplateResult {
  const [look, word] = stateOf(session, rate);
  return html`<span class="state"><span class="dot ${look}"></span>${word}</span>`;
}

function stateOf(session: Session, rate: number): [string, string] {
  switch (session.state) {
    case 'preparing':
      return ['preparing', 'Preparing'];
    case 'completed':
      return ['completed', 'Completed'];
    case 'failed':
      return ['failed', 'Failed'];
    case 'ready':
      return rate > 0 ? ['running', `Running, ${text.perSecond(rate)}`] : ['waiting', 'Waiting'];
  }
}

function frames(session: Session) {
  const { received, solved, missing } = session.frames;
  if (session.state === 'preparing' && received === 0) return nothing;
  if (session.state === 'completed' || session.state === 'failed') return text.counted(solved, 'frame');
  if (received === 0) return html`<span class="muted">no frames yet</span>`;
  const gaps = missing.reduce((sum, [first, end]) => sum + end - first, 0);
  const remarks = [
    session.coding ? `${text.count(session.coding.frames)} compressed` : null,
    gaps > 0 ? `${text.count(gaps)} missing` : null,
  ].filter((remark) => remark !== null);
  const known = received + gaps;
  return html`
    <span
      >${solved === known ? text.counted(solved, 'frame') : `${text.count(solved)} of ${text.count(known)} frames`}</span
    >
    ${solved === known ? nothing : html`<progress aria-label="Frames solved" max=${known} value=${solved}></progress>`}
    ${remarks.length > 0 ? html`<div class="fine">${remarks.join(' · ')}</div>` : nothing}
  `;
}

function worstError({ coding, state }: Session, { worst }: Figures) {
  if (worst !== null || !coding || state === 'completed' || state === 'failed') return text.percent(worst, 2);
  return html`<span class="muted" title="Errors are known when frames are compressed">compressing</span>`;
}

function sizes(session: Session, figures: Figures | null) {
  if (session.state !== 'completed' && session.coding) return text.size(session.coding.bytes);
  const bytes = figures?.bytes ?? null;
  if (!figures || bytes === null) return nothing;
  const ratio =
    figures.ratio === null ? nothing : html` <span class="fine">${text.ratio(figures.ratio)} smaller</span>`;
  return html`${text.size(bytes)}${ratio}`;
}

function download(row: Row, name: string) {
  if (row.session.state !== 'completed') return nothing;
  const { downloaded } = row;
  const label = downloaded === null ? `Download ${name}` : `Downloading ${name}, ${Math.round(100 * downloaded)} %`;
  return html`
    <button
      type="button"
      class="download"
      title="Download"
      aria-label=${label}
      ?disabled=${downloaded !== null}
      @click=${() => row.onDownload('cager')}
    >
      ${downloaded === null ? glyphs.download : html`<span class="fine">${Math.round(100 * downloaded)}%</span>`}
    </button>
    <select
      class="formats"
      title="Export"
      aria-label="Export ${name}"
      ?disabled=${downloaded !== null}
      @change=${({ target }: Event) => {
        const chosen = target as HTMLSelectElement;
        row.onDownload(chosen.value as Format);
        chosen.value = '';
      }}
    >
      <option value="" hidden selected>Export</option>
      ${Object.entries(FORMATS).map(([ending, program]) => html`<option value=${ending}>${program} (.${ending})</option>`)}
    </select>
  `;
}

function change(row: Row, name: string) {
  return html`
    <button type="button" title="Rename" aria-label="Rename ${name}" @click=${row.onRename}>${glyphs.pencil}</button>
    <button type="button" class="remove" title="Delete" aria-label="Delete ${name}" @click=${row.onRemove}>
      ${glyphs.trash}
    </button>
  `;
}

/** Why it failed and what to do, and, to be unfolded, what to know of it. */
function remarks(session: Session) {
  const wrong = session.problem ?? session.coding?.problem;
  const { warnings } = session;
  if (!wrong && warnings.length === 0) return nothing;
  const line = (look: string, sentence: string) =>
    html`<p class="problem ${look}">${glyphs.alert}<span>${sentence}</span></p>`;
  return html`
    <tr class="more" role="row">
      <td role="cell" colspan="8">
        ${wrong ? line('', problemFrom(wrong).message) : nothing}
        ${
          warnings.length > 0
            ? html`<details>
                <summary>${text.counted(warnings.length, 'warning')}</summary>
                ${warnings.map((warning) => line('mild', sentenceOf(new Error(warning))))}
              </details>`
            : nothing
        }
      </td>
    </tr>
  `;
}
