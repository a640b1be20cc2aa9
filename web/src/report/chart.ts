import { html, LitElement, nothing, unsafeCSS, type PropertyValues } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import uPlot from 'uplot';
import uPlotStyle from 'uplot/dist/uPlot.min.css?inline';
import { resolvedColor } from '../style/resolvedColor';
import { controls } from '../style/tokens';
import { threeDigits } from '../viewer/text';
import { aligned } from './chartData';
import { chartStyle } from './chartStyle';
import { plotOptions, type ChartOptions } from './plotOptions';

export type { Point } from './chartData';
export type { ChartOptions, Cover, Series } from './plotOptions';

const HEIGHT = 264;
/** Series whose values are told at once. */
const TOLD = 3;

/** A chart with a legend that shows the values under the pointer and hides series. Dragging across it zooms, a double click shows all again. */
@customElement('report-chart')
export class Chart extends LitElement {
  static override styles = [controls, unsafeCSS(uPlotStyle), chartStyle];

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
    const { data, gaps } = aligned(this.options.series, this.options.x.cover === 'log', this.options.y.cover === 'log');
    const options = plotOptions(this.options, {
      width: this.clientWidth,
      height: HEIGHT,
      isOnlyOne: data[0].length === 1,
      spansGaps: gaps === 'span',
      color: (value) => resolvedColor(this.renderRoot, value),
      style: getComputedStyle(this),
      onCursor: (plot) => this.read(plot),
    });
    this.plot = new uPlot(options, data, place);
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

declare global {
  interface HTMLElementTagNameMap {
    'report-chart': Chart;
  }
}
