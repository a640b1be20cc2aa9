import { html, LitElement, nothing, type PropertyValues, css } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import { controls } from '../style/controls';
import { threeDigits } from '../text';
import { axisOf, type Axis } from './axis';
import { plot, plotStyle, type Point, type Series } from './plot';

export const chartStyle = css`
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
  .frame {
    display: grid;
    grid-template: 214px 40px / 22px 1fr;
    gap: 0;
    padding: 10px 14px 0 0;
  }
  .area {
    grid-column: 2;
    position: relative;
    margin-left: 36px;
    cursor: crosshair;
    touch-action: pan-y;
    user-select: none;
  }
  .name {
    align-self: end;
    grid-column: 2;
    padding-left: 36px;
    font-size: 11px;
    text-align: center;
  }
  .area + .name {
    grid-area: 1 / 1;
    align-self: center;
    justify-self: center;
    padding: 0;
    writing-mode: vertical-rl;
    text-orientation: sideways;
    rotate: 180deg;
    white-space: nowrap;
  }
  :is(.cursor, .range) {
    position: absolute;
    inset-block: 0;
    border-left: 1px dashed var(--cager-line-strong);
    pointer-events: none;
  }
  .range {
    border: 0;
    background: var(--cager-accent-soft);
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
    color: var(--cager-text);
    font-size: var(--cager-size-small);
  }
  .legend [aria-pressed='false'] {
    opacity: 0.62;
    text-decoration: line-through;
  }
  .legend i {
    width: 16px;
    border-top: 2px solid;
  }
  .legend .dashes {
    border-top-style: dashed;
  }
  .legend :is(.dots, .squares) {
    width: 8px;
    height: 8px;
    border: 0;
    border-radius: 50%;
    background: currentColor;
  }
  .legend .squares {
    border-radius: 1px;
  }
`;

export type { Point, Series } from './plot';

/** How an axis covers its values: from zero, around them, or logarithmically. */
export type Cover = 'zero' | 'around' | 'log';

export interface ChartOptions {
  readonly title: string;
  readonly x: { readonly label: string; readonly cover?: 'around' | 'log' };
  readonly y: { readonly label: string; readonly cover: Cover };
  readonly series: readonly Series[];
}

/** Series whose values are told at once. */
const TOLD = 3;
/** Pixels that a drag to zoom has at least. */
const LEAST_DRAG = 4;

/** A chart with a legend that shows the values under the pointer and hides series. Dragging across it zooms, a double click shows all again. */
@customElement('cager-chart')
export class Chart extends LitElement {
  static override styles = [controls, plotStyle, chartStyle];

  @property({ attribute: false }) options: ChartOptions | null = null;
  @state() private hiddenSeries: ReadonlySet<string> = new Set();
  @state() private focused: string | null = null;
  /** The part of x that is shown; null for all. */
  @state() private zoomed: readonly [number, number] | null = null;
  /** Shares of the width between which somebody drags. */
  @state() private dragged: readonly [number, number] | null = null;
  @state() private at: number | null = null;
  private height = 0.5;
  private x: Axis = axisOf([0, 1], 0);
  private y: Axis = this.x;
  private shown: readonly Series[] = [];

  protected override willUpdate(changed: PropertyValues<this>) {
    if (changed.has('options')) {
      this.hiddenSeries = new Set();
      this.zoomed = this.at = null;
    }
    if (!this.options) return;
    const { x, y, series } = this.options;
    const isUsable = ([at, value]: Point) =>
      !(x.cover === 'log' && at <= 0) && !(y.cover === 'log' && value !== null && value <= 0);
    this.shown = series
      .filter(({ label }) => !this.hiddenSeries.has(label))
      .map((one) => ({ ...one, points: one.points.filter(isUsable).toSorted(([a], [b]) => a - b) }));
    const all = this.shown.flatMap(({ points }) => points);
    this.x = axisOf(
      this.zoomed ??
        endsOf(
          all.map(([at]) => at),
          x.cover ?? 'exact',
        ),
      8,
      x.cover === 'log',
    );
    const [low, high] = this.x.ends;
    const seen = all.flatMap(([at, value]) => (value !== null && at >= low && at <= high ? [value] : []));
    this.y = axisOf(endsOf(seen, y.cover), 6, y.cover === 'log');
  }

  override render() {
    if (!this.options) return nothing;
    const { title, series, x, y } = this.options;
    const { focused, dragged, at } = this;
    const lines = this.shown.map((one) => ({ ...one, isPale: focused !== null && focused !== one.label }));
    return html`
      <header>
        <h4>${title}</h4>
        <span class="reading grow clip fine figures" aria-live="polite">${this.reading()}</span>
      </header>
      <div class="frame">
        <div
          class="area"
          tabindex="0"
          role="img"
          aria-label="${title}: ${y.label} over ${x.label}. Left and right arrow keys read values."
          @keydown=${this.step}
          @pointerdown=${this.point}
          @pointermove=${this.point}
          @pointerup=${this.release}
          @pointerleave=${() => (this.at = null)}
          @dblclick=${() => (this.zoomed = null)}
        >
          ${plot({ x: this.x, y: this.y, series: lines, text: tick })}
          ${at === null ? nothing : html`<i class="cursor" .style=${`left:${100 * this.x.place(at)}%`}></i>`}
          ${dragged && html`<i class="range" .style=${`left:${100 * Math.min(...dragged)}%;right:${100 - 100 * Math.max(...dragged)}%`}></i>`}
        </div>
        <span class="name fine">${y.label}</span><span class="name fine">${x.label}</span>
      </div>
      <div class="legend">
        ${series
          .filter(({ label }) => label !== '')
          .map(
            ({ label, color, mark }) =>
              html`<button
                aria-pressed=${String(!this.hiddenSeries.has(label))}
                title="Show or hide this series"
                @click=${() => this.toggle(label)}
                @pointerenter=${() => (this.focused = label)}
                @pointerleave=${() => (this.focused = null)}
              >
                <i class=${mark} .style=${`color:${color}`}></i>${label}
              </button>`,
          )}
      </div>
    `;
  }

  private toggle(label: string) {
    const hidden = new Set(this.hiddenSeries);
    if (!hidden.delete(label)) hidden.add(label);
    this.hiddenSeries = hidden;
  }

  /** What the series have at the x that is read, those next to the pointer first. */
  private reading(): string {
    const { at, options } = this;
    if (at === null || !options) return '';
    const known = this.shown.flatMap(({ label, points }) =>
      points
        .filter(([x, value]) => x === at && value !== null)
        .map(([, value]) => ({
          text: label === '' ? threeDigits(value!) : `${label}: ${threeDigits(value!)}`,
          away: Math.abs(this.y.place(value!) - this.height),
        })),
    );
    const told = known.sort((a, b) => a.away - b.away).slice(0, TOLD);
    return [`${options.x.label} ${threeDigits(at)}`, ...told.map(({ text }) => text)].join(' · ');
  }

  /** Every x within sight that there is a value for. */
  private places(): number[] {
    const [low, high] = this.x.ends;
    const all = this.shown.flatMap(({ points }) => points.map(([x]) => x));
    return [...new Set(all)].filter((x) => x >= low && x <= high).sort((a, b) => a - b);
  }

  private readonly point = (event: PointerEvent) => {
    const area = event.currentTarget as HTMLElement;
    const { left, top, width, height } = area.getBoundingClientRect();
    const share = Math.min(1, Math.max(0, (event.clientX - left) / width));
    this.height = 1 - (event.clientY - top) / height;
    if (event.type === 'pointerdown' && event.button === 0 && event.pointerType !== 'touch') {
      area.setPointerCapture(event.pointerId);
      this.dragged = [share, share];
    } else if (this.dragged) this.dragged = [this.dragged[0], share];
    const away = (x: number) => Math.abs(this.x.place(x) - share);
    this.at = this.places().reduce<number | null>((a, b) => (a !== null && away(a) <= away(b) ? a : b), null);
  };

  private readonly release = (event: PointerEvent) => {
    const [from, to] = (this.dragged ?? [0, 0]).toSorted((a, b) => a - b);
    this.dragged = null;
    const { clientWidth } = event.currentTarget as HTMLElement;
    if ((to - from) * clientWidth >= LEAST_DRAG) this.zoomed = [this.x.valueAt(from), this.x.valueAt(to)];
  };

  private step(event: KeyboardEvent) {
    if (event.key !== 'ArrowLeft' && event.key !== 'ArrowRight') return;
    event.preventDefault();
    const places = this.places();
    const way = event.key === 'ArrowRight' ? 1 : -1;
    const next = this.at === null ? (way > 0 ? 0 : places.length - 1) : places.indexOf(this.at) + way;
    this.height = 0.5;
    this.at = places[Math.min(places.length - 1, Math.max(0, next))] ?? null;
  }
}

function endsOf(values: readonly number[], cover: Cover | 'exact'): [number, number] {
  const finite = values.filter(Number.isFinite);
  const [low, high] = finite.reduce(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]);
  if (finite.length === 0) return [cover === 'log' ? 0.1 : 0, 1];
  if (cover === 'zero') return [0, high > 0 ? 1.06 * high : 1];
  if (cover === 'log') return [low / 1.3, high * 1.3];
  if (low === high) return [low - 1, high + 1];
  const room = cover === 'around' ? 0.06 * (high - low) : 0;
  return [low - room, high + room];
}

function tick(value: number): string {
  return Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-4)
    ? value.toExponential(0)
    : String(Number(value.toPrecision(6)));
}
