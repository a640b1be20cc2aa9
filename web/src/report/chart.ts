import { css, html, LitElement, nothing, unsafeCSS, type PropertyValues } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import uPlot from 'uplot';
import uPlotStyle from 'uplot/dist/uPlot.min.css?inline';
import { resolvedColor } from '../style/resolvedColor';
import { controls } from '../style/tokens';
import { threeDigits } from '../viewer/text';
import { aligned, type Point } from './chartData';

export type { Point } from './chartData';

/** A line or a set of points in a chart. */
export interface Series {
  readonly label: string;
  /** CSS, may depend on the theme. */
  readonly color: string;
  readonly mark: 'line' | 'dashes' | 'dots' | 'diamonds';
  readonly points: readonly Point[];
}

/** How an axis covers its values: from zero, around them, or logarithmically. */
export type Cover = 'zero' | 'around' | 'log';

export interface ChartOptions {
  readonly title: string;
  readonly x: { readonly label: string; readonly cover?: 'around' | 'log' };
  readonly y: { readonly label: string; readonly cover: Cover };
  readonly series: readonly Series[];
}

const HEIGHT = 264;
/** Series whose values are told at once. */
const TOLD = 3;
/** The enumeration of distributions exists in uPlot's types alone. */
const LOGARITHMIC: object = { distr: 3, log: 10 };

/** A chart with a legend that shows the values under the pointer and hides series. Dragging across it zooms, a double click shows all again. */
@customElement('report-chart')
export class Chart extends LitElement {
  static override styles = [
    controls,
    unsafeCSS(uPlotStyle),
    css`
      :host {
        display: block;
        min-width: 0;
      }
      header {
        display: flex;
        flex-wrap: wrap;
        align-items: baseline;
        gap: 0 var(--cager-space-3);
        min-height: 22px;
      }
      h4 {
        margin: 0;
        font-size: var(--cager-size);
        font-weight: 600;
      }
      .plot {
        position: relative;
        border-radius: var(--cager-radius-small);
      }
      .u-wrap {
        font-family: var(--cager-font);
      }
      .u-select {
        background: var(--cager-accent-soft);
      }
      .u-cursor-x,
      .u-cursor-y {
        border-color: var(--cager-line-strong);
      }
      .legend {
        display: flex;
        flex-wrap: wrap;
        gap: 0 2px;
        margin-top: var(--cager-space-1);
      }
      .legend button {
        min-height: 24px;
        padding: 0 6px;
        gap: 6px;
        border: 0;
        background: none;
        font-size: var(--cager-size-small);
        color: var(--cager-text);
      }
      .legend button[aria-pressed='false'] {
        opacity: 0.62;
        text-decoration: line-through;
      }
      .legend i {
        width: 16px;
        height: 0;
        border-top: 2px solid;
      }
      .legend i.dashes {
        border-top-style: dashed;
      }
      .legend i.dots,
      .legend i.diamonds {
        width: 8px;
        height: 8px;
        border: 0;
        border-radius: 50%;
        background: currentColor;
      }
      .legend i.diamonds {
        border-radius: 1px;
        rotate: 45deg;
      }
      .reading {
        flex: 1;
        min-width: 0;
        overflow: hidden;
        text-overflow: ellipsis;
        white-space: nowrap;
        font-size: var(--cager-size-small);
        color: var(--cager-muted);
      }
    `,
  ];

  @property({ attribute: false }) options: ChartOptions | null = null;
  @state() private hiddenSeries: ReadonlySet<string> = new Set();
  @state() private reading = '';
  private plot: uPlot | null = null;
  private readonly sizes = new ResizeObserver(() => this.fit());
  private readonly theme = matchMedia('(prefers-color-scheme: dark)');
  private readonly repaint = () => this.draw();

  override render() {
    if (!this.options) return nothing;
    const { title, series } = this.options;
    return html`
      <header>
        <h4>${title}</h4>
        <span class="reading figures" aria-live="polite">${this.reading}</span>
      </header>
      <div
        class="plot"
        tabindex="0"
        role="img"
        aria-label="${title}: ${this.options.y.label} over ${this.options.x.label}. Left and right arrow keys read values."
        @keydown=${this.step}
      ></div>
      <div class="legend">
        ${series
          .filter(({ label }) => label !== '')
          .map(
            ({ label, color, mark }) =>
              html`<button
                aria-pressed=${String(!this.hiddenSeries.has(label))}
                title="Show or hide this series"
                @click=${() => this.toggle(label)}
                @pointerenter=${() => this.highlight(label)}
                @pointerleave=${() => this.highlight(null)}
              >
                <i class=${mark} .style=${`color:${color}`}></i>${label}
              </button>`,
          )}
      </div>
    `;
  }

  override connectedCallback() {
    super.connectedCallback();
    this.theme.addEventListener('change', this.repaint);
    this.sizes.observe(this);
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.theme.removeEventListener('change', this.repaint);
    this.sizes.disconnect();
    this.plot?.destroy();
    this.plot = null;
  }

  protected override updated(changed: PropertyValues<this>) {
    if (changed.has('options')) this.draw();
  }

  private draw() {
    const place = this.renderRoot.querySelector<HTMLElement>('.plot');
    this.plot?.destroy();
    this.plot = null;
    this.reading = '';
    if (!place || !this.options || this.clientWidth === 0) return;
    const { x, y, series } = this.options;
    const style = getComputedStyle(this);
    const color = (value: string) => resolvedColor(this.renderRoot, value);
    const [text, line] = ['--cager-muted', '--cager-line'].map((name) => color(style.getPropertyValue(name)));
    const font = `11px ${style.getPropertyValue('--cager-font')}`;
    const { data, gaps } = aligned(series, x.cover === 'log', y.cover === 'log');
    const axis = {
      stroke: text,
      font,
      labelFont: font,
      labelSize: 18,
      grid: { stroke: line, width: 1 },
      ticks: { stroke: line, width: 1, size: 4 },
    };
    const values = (_: uPlot, splits: (number | null)[]) => splits.map(tick);
    const isLog = (cover: string | undefined) => (cover === 'log' ? LOGARITHMIC : {});
    this.plot = new uPlot(
      {
        width: this.clientWidth,
        height: HEIGHT,
        padding: [10, 14, 0, 0],
        legend: { show: false },
        cursor: { points: { size: 7 }, focus: { prox: 30 }, drag: { x: true, y: false, uni: 20 } },
        focus: { alpha: 0.25 },
        scales: {
          x: { time: false, ...isLog(x.cover), ...(isOnlyOne(data[0]) ? { range: around } : {}) },
          y: { ...isLog(y.cover), ...(y.cover === 'zero' ? { range: fromZero } : {}) },
        },
        axes: [
          { ...axis, label: x.label, size: 30, values },
          { ...axis, label: y.label, size: 58, values },
        ],
        series: [
          {},
          ...series.map(({ label, mark, color: of }) => ({
            label,
            stroke: color(of),
            width: 1.6,
            spanGaps: gaps === 'span',
            ...(mark === 'dashes' ? { dash: [5, 4] } : {}),
            ...(mark === 'dots' || mark === 'diamonds'
              ? {
                  paths: () => null,
                  points: {
                    show: true,
                    size: mark === 'diamonds' ? 11 : 7,
                    fill: color(of),
                    ...(mark === 'diamonds' ? { stroke: text } : {}),
                  },
                }
              : { points: { size: 5, fill: color(of), ...(mark === 'dashes' ? { show: false } : {}) } }),
          })),
        ],
        hooks: { setCursor: [(plot) => this.read(plot)] },
      },
      data,
      place,
    );
    this.hiddenSeries = new Set();
  }

  private fit() {
    if (!this.plot) this.draw();
    else if (this.clientWidth > 0 && this.plot.width !== this.clientWidth)
      this.plot.setSize({ width: this.clientWidth, height: HEIGHT });
  }

  private toggle(label: string) {
    const hidden = new Set(this.hiddenSeries);
    if (!hidden.delete(label)) hidden.add(label);
    this.hiddenSeries = hidden;
    this.options?.series.forEach((series, k) => this.plot?.setSeries(k + 1, { show: !hidden.has(series.label) }));
  }

  private highlight(label: string | null) {
    const index = this.options?.series.findIndex((series) => series.label === label) ?? -1;
    this.plot?.setSeries(index < 0 ? null : index + 1, { focus: index >= 0 });
  }

  /** Says what the series have at the pointer's x, those next to the pointer first. */
  private read(plot: uPlot) {
    const { idx, top = 0 } = plot.cursor;
    if (idx === null || idx === undefined || !this.options) {
      this.reading = '';
      return;
    }
    const { x, series } = this.options;
    const known = series.flatMap(({ label }, k) => {
      const value = plot.data[k + 1][idx];
      if (value === null || value === undefined || plot.series[k + 1].show === false) return [];
      const text = label === '' ? threeDigits(value) : `${label}: ${threeDigits(value)}`;
      return [{ text, away: Math.abs(plot.valToPos(value, 'y') - top) }];
    });
    const told = known.sort((a, b) => a.away - b.away).slice(0, TOLD);
    this.reading = [`${x.label} ${threeDigits(plot.data[0][idx])}`, ...told.map(({ text }) => text)].join(' · ');
  }

  private step(event: KeyboardEvent) {
    const { plot } = this;
    if (!plot || (event.key !== 'ArrowLeft' && event.key !== 'ArrowRight')) return;
    event.preventDefault();
    const count = plot.data[0].length;
    const way = event.key === 'ArrowRight' ? 1 : -1;
    const at =
      plot.cursor.idx === null || plot.cursor.idx === undefined ? (way > 0 ? 0 : count - 1) : plot.cursor.idx + way;
    const idx = Math.min(count - 1, Math.max(0, at));
    plot.setCursor({ left: plot.valToPos(plot.data[0][idx], 'x'), top: plot.over.clientHeight / 2 });
  }
}

/** Logarithmic axes have lines without a label. */
function tick(value: number | null): string {
  if (value === null) return '';
  return Math.abs(value) >= 1e5 ? value.toExponential(1) : String(Number(value.toPrecision(6)));
}

const fromZero = (_: uPlot, __: number, most: number): uPlot.Range.MinMax => [0, most > 0 ? 1.06 * most : 1];

const around = (_: uPlot, low: number): uPlot.Range.MinMax => [low - 1, low + 1];

function isOnlyOne(values: ArrayLike<number>): boolean {
  return values.length === 1;
}

declare global {
  interface HTMLElementTagNameMap {
    'report-chart': Chart;
  }
}
