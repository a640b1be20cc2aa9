import { html, LitElement, nothing } from 'lit';
import { customElement, property } from 'lit/decorators.js';
import { controls } from '../style/controls';
import type { ChartOptions } from '../charts/chart';
import type { Figure, Report } from './data';
import { footer, charts, table, viewsOf } from './table';
import { RestPose } from './geometry/modelInCage';
import { methodColor } from './methods';
import { reportStyle } from './reportStyle';
import { decimals } from './text';
import type { Moments, View } from './views';

const FRAMES_PER_SECOND = 30;
/** Errors that differ by more than this factor get a logarithmic axis. */
const LINEAR_SPAN = 1000;

/** The report of `cager demo`. */
@customElement('report-demo')
export class DemoReportPage extends LitElement {
  static override styles = [controls, reportStyle];

  @property({ attribute: false }) report: (Report & { kind: 'demo' }) | null = null;
  private motion: { views: readonly View[]; moments: Moments; framed: Float32Array } | null = null;
  private charts: readonly ChartOptions[] = [];

  override willUpdate() {
    if (this.motion || !this.report) return;
    const { geometry, figures } = this.report;
    this.motion = motionOf(geometry);
    const color = (handles: string, regularizer: string) => methodColor({ handles, regularizer });
    this.charts = [
      errorChart('L2: root mean square over the points', 'L2, %', color('all', 'none'), figures.l2),
      errorChart('L∞: largest over the points', 'L∞, %', color('maxvol', 'laplacian'), figures.linf),
      {
        title: 'Singular values of the coordinates of the points that are read',
        x: { label: 'singular value number' },
        y: { label: 'singular value', cover: 'log' },
        series: [
          {
            label: '',
            color: color('spread', 'laplacian'),
            mark: 'line',
            points: figures.singular_values.map((value, k) => [k + 1, value]),
          },
        ],
      },
    ];
    document.title = 'CageR: the built-in capture';
  }

  override render() {
    if (!this.report || !this.motion) return nothing;
    const { figures, geometry, program } = this.report;
    const { moments } = this.motion;
    const all = geometry.points.data === '' ? 0 : figures.l2.length;
    return html`
      <main>
        <h1>The built-in capture, encoded into cages</h1>
        <p class="lead">
          A capture that <code>cager demo</code> makes was sent to a real service, encoded there, decoded again and
          measured. Errors are percentages of the diagonal of the rest pose's bounding box.
        </p>
        ${viewsOf('The decoded model and its cage', this.motion, 'large-views')}
        <p class="caption">
          <b>The decoded model, and its cage.</b> ${moments.count} of ${all}
          frames${moments.count < all ? ', evenly spaced; between them positions are interpolated' : ''}.
        </p>
        ${charts(...this.charts)}
        <h2>Sizes, errors and times</h2>
        ${table(figures.rows, [
          ['', ({ name }) => name],
          ['', ({ value }) => value],
          ['', ({ note }) => html`<span class="note-cell muted">${note}</span>`],
        ])}
        ${footer(html`Written by <code>cager demo</code> ${program}. The same folder holds the rest pose, the cage, the encoded capture and the decoded frames.`)}
      </main>
    `;
  }
}

function motionOf(geometry: (Report & { kind: 'demo' })['geometry']) {
  const rest = new RestPose(geometry);
  const { frames } = geometry;
  const points = rest.placedFrom(geometry.points);
  const cages = rest.placedFrom(geometry.cages);
  const model = blended(points, frames.length);
  const cage = blended(cages, frames.length);
  const views: View[] = [
    {
      title: 'Model in its cage',
      note: '',
      drawing: (place) => ({
        surface: { positions: model(place), triangles: rest.triangles },
        cage: { mesh: rest.cage, vertices: cage(place) },
      }),
    },
    {
      title: 'Decoded model',
      note: '',
      drawing: (place) => ({ surface: { positions: model(place), triangles: rest.triangles } }),
    },
  ];
  const every = frames.length > 1 ? (frames[frames.length - 1] - frames[0]) / (frames.length - 1) : 1;
  const moments: Moments = {
    count: frames.length,
    first: 0,
    rate: FRAMES_PER_SECOND / Math.max(1, every),
    smooth: true,
    name: (place) => `frame ${frames[place] ?? 0}`,
  };
  return { views, moments, framed: cages };
}

function blended(all: Float32Array, frames: number): (place: number) => Float32Array {
  const size = all.length / frames;
  return (place) => {
    const first = Math.min(frames - 1, Math.floor(place));
    const next = Math.min(frames - 1, first + 1);
    const [a, b] = [all.subarray(first * size, (first + 1) * size), all.subarray(next * size, (next + 1) * size)];
    const share = place - first;
    return share === 0 ? a : a.map((x, k) => x + (b[k] - x) * share);
  };
}

function errorChart(title: string, label: string, color: string, errors: readonly Figure[]): ChartOptions {
  const known = errors.filter((error) => error !== null).map((error) => 100 * error);
  const positive = known.filter((error) => error > 0);
  const isWide = Math.max(...positive) > LINEAR_SPAN * Math.min(...positive);
  const mean = known.length === 0 ? null : known.reduce((sum, error) => sum + error, 0) / known.length;
  return {
    title,
    x: { label: 'frame' },
    y: { label, cover: isWide ? 'log' : 'zero' },
    series: [
      { label: 'of each frame', color, mark: 'line', points: errors.map((error, k) => [k, error && 100 * error]) },
      { label: `mean ${decimals(mean, 3)} %`, color, mark: 'dashes', points: errors.map((_, k) => [k, mean]) },
    ],
  };
}
