import { css, html, svg } from 'lit';
import type { Axis } from './axis';

/** x, and y where there is one. */
export type Point = readonly [number, number | null];

export interface Series {
  readonly label: string;
  /** CSS, may depend on the theme. */
  readonly color: string;
  readonly mark: 'line' | 'dashes' | 'dots' | 'squares';
  readonly points: readonly Point[];
}

/** What is drawn of series, whose points go from left to right: lines and marks, those of the axes with their labels. */
export interface Plot {
  readonly x: Axis;
  readonly y: Axis;
  readonly series: readonly (Series & { readonly isPale?: boolean })[];
  readonly text?: (value: number) => string;
}

/** Draws series. It fills an element with a position; its labels lie outside, on the left and below. */
export function plot({ x, y, series, text = String }: Plot) {
  return html`<svg class="plot" viewBox="0 0 1 1" preserveAspectRatio="none" aria-hidden="true">
      ${x.ticks.map((tick) => svg`<path class="grid" d="M${x.place(tick)} 0v1" />`)}
      ${y.ticks.map((tick) => svg`<path class="grid" d="M0 ${1 - y.place(tick)}h1" />`)}
      ${series.map(
        ({ color, mark, points, isPale }) =>
          svg`<path class="${mark} ${isPale ? 'pale' : ''}" .style=${`stroke:${color}`} d=${pathOf(points, x, y, mark)} />`,
      )}
    </svg>
    ${x.ticks.map((tick) => html`<span class="x" .style=${`left:${100 * x.place(tick)}%`}>${text(tick)}</span>`)}
    ${y.ticks.map((tick) => html`<span class="y" .style=${`bottom:${100 * y.place(tick)}%`}>${text(tick)}</span>`)}`;
}

/** Lines break where there is no value; a value alone is a dot, as every one of a set of points is. */
export function pathOf(points: readonly Point[], x: Axis, y: Axis, mark: Series['mark']): string {
  const isSet = mark === 'dots' || mark === 'squares';
  let isDrawing = false;
  return points
    .map(([at, value]) => {
      const [px, py] = value === null ? [NaN, NaN] : [x.place(at), 1 - y.place(value)];
      const isKnown = Number.isFinite(px) && Number.isFinite(py);
      const step = isDrawing && !isSet ? 'L' : 'M';
      const dot = step === 'M' ? 'h0' : '';
      isDrawing = isKnown;
      return isKnown ? `${step}${Number(px.toFixed(5))} ${Number(py.toFixed(5))}${dot}` : '';
    })
    .join('');
}

/** Points of a series of values at places from 0 to 1; where many share a place, the largest of them. */
export function thinned(values: ArrayLike<number>, place: (k: number) => number, columns = 400): Point[] {
  const found = new Map<number, [number, number | null]>();
  for (let k = 0; k < values.length; k++) {
    const at = place(k);
    const column = values.length > columns ? Math.floor(at * columns) : k;
    const before = found.get(column);
    const value = Number.isFinite(values[k]) ? values[k] : null;
    if (!before) found.set(column, [at, value]);
    else if (value !== null && !(before[1] !== null && before[1] >= value)) before[1] = value;
  }
  return [...found.values()];
}

export const plotStyle = css`
  svg.plot {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    overflow: hidden;
  }
  .plot path {
    fill: none;
    stroke-width: 1.5;
    stroke-linejoin: round;
    stroke-linecap: round;
    vector-effect: non-scaling-stroke;
  }
  .plot .grid {
    stroke: var(--cager-line);
    stroke-width: 1;
  }
  .plot .dashes {
    stroke-dasharray: 5 4;
    stroke-linecap: butt;
  }
  .plot .dots {
    stroke-width: 7;
  }
  .plot .squares {
    stroke-width: 10;
    stroke-linecap: square;
  }
  .plot .pale {
    opacity: 0.25;
  }
  :is(.x, .y) {
    position: absolute;
    color: var(--cager-muted);
    font: 11px/1 var(--cager-font);
    white-space: nowrap;
    pointer-events: none;
  }
  .x {
    top: calc(100% + 6px);
    translate: -50%;
  }
  .y {
    right: calc(100% + 6px);
    translate: 0 50%;
  }
`;
