import { html, LitElement, nothing } from 'lit';
import { customElement, property } from 'lit/decorators.js';
import { controls } from '../style/controls';
import { count } from '../text';
import type { CageFigures, Report } from './data';
import { footer, table, viewsOf } from './table';
import { joined, RestPose } from './geometry/modelInCage';
import { reportStyle } from './reportStyle';
import { condition, percents, seconds } from './text';
import type { View } from './views';

/** The page of a cage that `cager cage` made, checked or repaired. */
@customElement('report-cage')
export class CageReportPage extends LitElement {
  static override styles = [controls, reportStyle];

  @property({ attribute: false }) report: (Report & { kind: 'cage' }) | null = null;
  views: readonly View[] = [];
  framed: Float32Array = new Float32Array(0);

  override willUpdate() {
    if (this.views.length > 0 || !this.report) return;
    const rest = new RestPose(this.report.geometry);
    const cage = { mesh: rest.cage, vertices: rest.cageVertices };
    const model = { positions: rest.points, triangles: rest.triangles };
    const solid = { positions: rest.cageVertices, triangles: rest.cage.triangles, flat: true };
    this.framed = joined([rest.points, rest.cageVertices]);
    this.views = [
      { title: 'Model in the cage', note: '', drawing: () => ({ surface: model, cage }) },
      { title: 'Cage', note: '', drawing: () => ({ surface: solid, cage }) },
    ];
    document.title = `Cage: ${this.report.geometry.name ?? 'standard output'}`;
  }

  override render() {
    if (!this.report) return nothing;
    const { figures, geometry, program } = this.report;
    return html`
      <main>
        <h1>Cage ${geometry.name ?? ''}</h1>
        <p class="lead">
          ${count(figures.vertices)} vertices and ${count(figures.faces)} triangles around a model of
          ${count(geometry.mesh.of)} points.
        </p>
        ${(['warnings', 'findings', 'changes'] as const).map((name) => sentences(name, figures[name] ?? []))}
        ${viewsOf('Model and cage', this, 'large-views')}
        <h2>Figures</h2>
        ${table(counts(figures), [
          ['', ([name]) => name],
          ['', ([, value]) => value],
        ])}
        ${design(figures.design)} ${footer(html`Written by <code>cager cage</code> ${program}.`)}
      </main>
    `;
  }
}

function sentences(title: string, all: readonly string[]) {
  return all.length === 0
    ? nothing
    : html`<h2>${title[0].toUpperCase()}${title.slice(1)}</h2>
        <ul>
          ${all.map((sentence) => html`<li>${sentence}</li>`)}
        </ul>`;
}

/** Every number and every yes or no of the report. */
function counts(figures: CageFigures): string[][] {
  return Object.entries(figures).flatMap(([key, value]) => {
    const name = key.replaceAll('_', ' ');
    if (typeof value === 'boolean') return [[name, value ? 'yes' : 'no']];
    if (typeof value !== 'number') return [];
    if (key === 'seconds') return [['time', seconds(value)]];
    if (key === 'condition_number') return [[name, condition(value)]];
    if (key === 'outside_distance') return [[name, `${percents(value, 3)} % of the diagonal`]];
    return [[name, value.toLocaleString('en-US')]];
  });
}

function design(found: CageFigures['design']) {
  if (!found) return nothing;
  return html`
    <h2>Design</h2>
    <p>
      ${found.style[0].toUpperCase()}${found.style.slice(1)} cage, designed from ${found.frames} frames and chosen by as
      many between them. Errors are mean distances in percent of the diagonal.
      ${
        found.unseen_frames
          ? `On ${found.unseen_frames} frames in stretches of time that neither saw it is ${percents(found.unseen_error, 4)} %.`
          : 'There were too few frames to hold stretches of time back.'
      }
    </p>
    ${table(found.stages, [
      ['stage', (stage) => stage.name],
      ['vertices', (stage) => count(stage.vertices)],
      ['error of design %', (stage) => percents(stage.designed_error, 4)],
      ['error of choice %', (stage) => percents(stage.held_back_error, 4)],
      ['condition', (stage) => condition(stage.condition_number)],
      ['after', (stage) => seconds(stage.seconds)],
    ])}
  `;
}
