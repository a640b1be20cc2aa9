import { css, html, LitElement, svg, unsafeCSS, type PropertyValues } from 'lit';
import { customElement, property, query } from 'lit/decorators.js';
import uPlot from 'uplot';
import uPlotStyle from 'uplot/dist/uPlot.min.css?inline';
import type { FrameErrors } from '../capture';
import { weightAt, type FrameRange } from '../editing/cageEdit';
import { percent } from './text';
import { resolvedColor } from '../style/resolvedColor';
import { controls } from '../style/tokens';

/** Space left and right of the chart, for the labels of its axis and for half a thumb. */
const [GUTTER, MARGIN] = [46, 12];

/**
 * The timeline: a bar to scrub on and, where errors are known, their chart above it.
 *
 * @fires seek with the frame, a whole number, that was pointed at
 */
@customElement('cager-timeline')
export class Timeline extends LitElement {
  static override styles = [
    controls,
    unsafeCSS(uPlotStyle),
    css`
      :host {
        display: block;
        touch-action: none;
        user-select: none;
      }
      .slider {
        position: relative;
        cursor: pointer;
        border-radius: var(--cager-radius-small);
      }
      .chart {
        height: 58px;
        pointer-events: none;
      }
      .u-wrap {
        font-family: var(--cager-font);
      }
      .track {
        position: relative;
        height: 18px;
      }
      .rail,
      .done {
        position: absolute;
        top: 7px;
        left: 0;
        height: 4px;
        width: 100%;
        border-radius: 2px;
        background: color-mix(in srgb, var(--cager-muted) 32%, transparent);
      }
      .done {
        background: var(--cager-accent);
        transform-origin: left;
      }
      .thumb {
        position: absolute;
        top: 2px;
        left: 0;
        width: 14px;
        height: 14px;
        margin-left: -7px;
        border-radius: 50%;
        background: var(--cager-accent);
        border: 2px solid var(--cager-surface);
        box-shadow: 0 1px 4px rgb(0 0 0 / 0.35);
        transition: scale var(--cager-fast);
      }
      .slider:hover .thumb {
        scale: 1.2;
      }
      .range {
        position: absolute;
        top: 0;
        left: 0;
        width: 100%;
        height: 9px;
        overflow: visible;
        fill: color-mix(in srgb, var(--cager-cage) 45%, transparent);
        stroke: var(--cager-cage);
        stroke-width: 1.25;
        stroke-linejoin: round;
      }
      .needle,
      .hover {
        position: absolute;
        top: 0;
        bottom: 12px;
        width: 1px;
        background: var(--cager-accent);
        pointer-events: none;
      }
      .hover {
        background: var(--cager-line-strong);
      }
      .tip {
        position: absolute;
        bottom: calc(100% + 2px);
        padding: 3px 8px;
        border-radius: var(--cager-radius-small);
        background: var(--cager-text);
        color: var(--cager-background);
        font-size: var(--cager-size-small);
        white-space: nowrap;
        translate: -50% 0;
        pointer-events: none;
        z-index: 2;
      }
      @media (max-height: 520px), (max-width: 560px) {
        .chart {
          height: 44px;
        }
      }
      @container (max-width: 320px) or (max-height: 220px) {
        .chart,
        .needle,
        .hover {
          display: none;
        }
      }
    `,
  ];

  /** Frames there are. */
  @property({ type: Number }) frames = 0;
  @property({ attribute: false }) errors: FrameErrors | null = null;
  /** Numbers of the frames where they come from, if these are others. */
  @property({ attribute: false }) frameNumbers: Float64Array | null = null;
  /** Frames that an edit is kept over, drawn as high as it counts in each. */
  @property({ attribute: false }) range: FrameRange | null = null;
  /** Changes when colours do: the chart is drawn anew. */
  @property({ type: Number }) look = 0;
  @query('.chart') private readonly chartPlace!: HTMLElement | null;
  @query('.slider') private readonly slider!: HTMLElement;
  private place = 0;
  private hovered: number | null = null;
  private chart: uPlot | null = null;
  private readonly sizes = new ResizeObserver(() => this.resize());

  /** The place in the capture that is shown, between two frames too. */
  get position(): number {
    return this.place;
  }

  set position(position: number) {
    this.place = position;
    // Sixty times a second: not worth a render of the template.
    if (this.hasUpdated) this.movePlace();
  }

  override render() {
    const measured = this.isMeasured();
    return html`
      <div
        class="slider"
        role="slider"
        tabindex="0"
        aria-label="Frame"
        aria-valuemin="0"
        aria-valuemax=${Math.max(0, this.frames - 1)}
        aria-valuenow=${Math.round(this.place)}
        @pointerdown=${this.grab}
        @pointermove=${this.move}
        @pointerleave=${this.leave}
      >
        ${measured ? html`<div class="chart"></div>` : null}
        <div class="needle" ?hidden=${!measured}></div>
        <div class="hover" hidden></div>
        <div class="tip figures" hidden></div>
        <div class="track">
          ${this.range ? rangeDrawing(this.range, this.frames) : null}
          <div class="rail"></div>
          <div class="done"></div>
          <div class="thumb"></div>
        </div>
      </div>
    `;
  }

  override connectedCallback() {
    super.connectedCallback();
    this.sizes.observe(this);
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.sizes.disconnect();
    this.chart?.destroy();
    this.chart = null;
  }

  protected override updated(changed: PropertyValues) {
    if (changed.has('look') || !this.chartPlace || !this.chart) this.drawChart();
    else if (changed.has('errors') || changed.has('frames')) this.chart.setData(this.chartData());
    this.resize();
  }

  private isMeasured(): boolean {
    return this.frames > 1 && (this.errors?.linf.some(Number.isFinite) ?? false);
  }

  private drawChart() {
    this.chart?.destroy();
    this.chart = null;
    if (!this.chartPlace) return;
    const style = getComputedStyle(this);
    const color = (name: string) => resolvedColor(this.renderRoot, style.getPropertyValue(name));
    const [worst, mean, text, line] = ['--cager-cage', '--cager-accent', '--cager-muted', '--cager-line'].map(color);
    const options: uPlot.Options = {
      width: Math.max(60, this.clientWidth),
      height: this.chartPlace.clientHeight,
      padding: [6, MARGIN, 8, 0],
      cursor: { show: false },
      legend: { show: false },
      select: { show: false, left: 0, top: 0, width: 0, height: 0 },
      scales: {
        x: { time: false, range: () => [0, Math.max(1, this.frames - 1)] },
        y: { range: (_, __, most) => [0, Math.max(most * 1.08, 1e-9)] },
      },
      axes: [
        { show: false },
        {
          size: GUTTER,
          gap: 4,
          stroke: text,
          font: `11px ${style.getPropertyValue('--cager-font')}`,
          space: 16,
          grid: { stroke: line, width: 1 },
          ticks: { show: false },
          values: (_, splits) => splits.map((value) => percent(value)),
        },
      ],
      series: [
        {},
        { label: 'L∞', stroke: worst, width: 1.25, fill: withOpacity(worst, 0.1), points: { show: false } },
        { label: 'L2', stroke: mean, width: 1.5, points: { show: false } },
      ],
    };
    this.chart = new uPlot(options, this.chartData(), this.chartPlace);
  }

  private chartData(): uPlot.AlignedData {
    const { linf, l2 } = this.errors ?? { linf: new Float32Array(0), l2: new Float32Array(0) };
    const frames = Array.from({ length: this.frames }, (_, k) => k);
    const series = (values: Float32Array) => frames.map((k) => (Number.isFinite(values[k]) ? values[k] : null));
    return [frames, series(linf), series(l2)];
  }

  private resize() {
    const width = this.clientWidth;
    if (width === 0) return;
    if (this.chart && this.chartPlace) this.chart.setSize({ width, height: this.chartPlace.clientHeight });
    const track = this.renderRoot.querySelector<HTMLElement>('.track')!;
    track.style.marginLeft = `${this.left()}px`;
    track.style.marginRight = `${MARGIN}px`;
    this.movePlace();
  }

  private left(): number {
    return this.chartPlace?.clientHeight ? GUTTER : MARGIN;
  }

  private movePlace() {
    const share = this.frames > 1 ? Math.min(1, this.place / (this.frames - 1)) : 0;
    const width = this.clientWidth - this.left() - MARGIN;
    const style = (name: string) => this.renderRoot.querySelector<HTMLElement>(name)!.style;
    style('.done').transform = `scaleX(${share})`;
    style('.thumb').transform = `translateX(${share * width}px)`;
    style('.needle').left = `${this.left() + share * width}px`;
    const frame = Math.round(this.place);
    this.slider.setAttribute('aria-valuenow', String(frame));
    this.slider.setAttribute('aria-valuetext', this.description(frame));
  }

  private description(frame: number): string {
    const number = this.frameNumbers?.[frame];
    const own = number === undefined || number === frame ? '' : ` (number ${number})`;
    const [l2, linf] = [this.errors?.l2[frame], this.errors?.linf[frame]];
    const error =
      l2 !== undefined && linf !== undefined && Number.isFinite(linf)
        ? ` · L2 ${percent(l2)} · L∞ ${percent(linf)}`
        : '';
    return `frame ${frame}${own}${error}`;
  }

  private frameAt(event: PointerEvent): number {
    const box = this.slider.getBoundingClientRect();
    const width = Math.max(1, box.width - this.left() - MARGIN);
    const share = Math.min(1, Math.max(0, (event.clientX - box.left - this.left()) / width));
    return Math.round(share * Math.max(0, this.frames - 1));
  }

  private grab(event: PointerEvent) {
    if (event.button !== 0) return;
    this.slider.setPointerCapture(event.pointerId);
    this.seek(this.frameAt(event));
  }

  private move(event: PointerEvent) {
    const frame = this.frameAt(event);
    this.showTip(frame);
    if (event.buttons & 1 && this.slider.hasPointerCapture(event.pointerId)) this.seek(frame);
  }

  private leave() {
    this.showTip(null);
  }

  private showTip(frame: number | null) {
    this.hovered = this.frames > 1 ? frame : null;
    const [tip, hover] = ['.tip', '.hover'].map((name) => this.renderRoot.querySelector<HTMLElement>(name)!);
    tip.hidden = hover.hidden = this.hovered === null;
    if (this.hovered === null) return;
    const width = this.clientWidth - this.left() - MARGIN;
    const at = this.left() + (this.hovered / (this.frames - 1)) * width;
    tip.textContent = this.description(this.hovered);
    const half = tip.offsetWidth / 2;
    tip.style.left = `${Math.min(this.clientWidth - half, Math.max(half, at))}px`;
    hover.style.left = `${at}px`;
  }

  private seek(frame: number) {
    this.dispatchEvent(new CustomEvent<number>('seek', { detail: frame }));
  }
}

/** The weight of an edit over the frames of a capture. */
function rangeDrawing(range: FrameRange, frames: number) {
  const { first, last } = range;
  const points = [`${first},1`];
  for (let frame = first; frame <= last; frame++) points.push(`${frame},${1 - weightAt(range, frame)}`);
  points.push(`${last},1`);
  return svg`<svg class="range" viewBox="0 0 ${Math.max(1, frames - 1)} 1" preserveAspectRatio="none" aria-hidden="true">
    <polygon points=${points.join(' ')} vector-effect="non-scaling-stroke" />
  </svg>`;
}

function withOpacity(color: string, opacity: number): string {
  return color.replace(/^rgb\((.*)\)$/, (_, channels: string) => `rgb(${channels.replaceAll(',', ' ')} / ${opacity})`);
}
