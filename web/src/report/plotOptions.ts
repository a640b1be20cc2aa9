/** How uPlot draws a chart of a report. */

import type uPlot from 'uplot';
import type { Point } from './chartData';

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

/** What a plot needs to know of the element around it, and of its data. */
export interface PlotPlace {
  readonly width: number;
  readonly height: number;
  /** Whether all values have the same x. */
  readonly isOnlyOne: boolean;
  /** Whether lines go on over places without a value. */
  readonly spansGaps: boolean;
  /** A colour of CSS as canvases take it. */
  readonly color: (value: string) => string;
  readonly style: CSSStyleDeclaration;
  readonly onCursor: (plot: uPlot) => void;
}

/** The enumeration of distributions exists in uPlot's types alone. */
const LOGARITHMIC: object = { distr: 3, log: 10 };

export function plotOptions(
  options: ChartOptions,
  { width, height, isOnlyOne, spansGaps, color, style, onCursor }: PlotPlace,
): uPlot.Options {
  const { x, y, series } = options;
  const [text, line] = ['--cager-muted', '--cager-line'].map((name) => color(style.getPropertyValue(name)));
  const font = `11px ${style.getPropertyValue('--cager-font')}`;
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
  return {
    width,
    height,
    padding: [10, 14, 0, 0],
    legend: { show: false },
    cursor: { points: { size: 7 }, focus: { prox: 30 }, drag: { x: true, y: false, uni: 20 } },
    focus: { alpha: 0.25 },
    scales: {
      x: { time: false, ...isLog(x.cover), ...(isOnlyOne ? { range: around } : {}) },
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
        spanGaps: spansGaps,
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
    hooks: { setCursor: [onCursor] },
  };
}

/** Logarithmic axes have lines without a label. */
function tick(value: number | null): string {
  if (value === null) return '';
  return Math.abs(value) >= 1e5 ? value.toExponential(1) : String(Number(value.toPrecision(6)));
}

const fromZero = (_: uPlot, __: number, most: number): uPlot.Range.MinMax => [0, most > 0 ? 1.06 * most : 1];

const around = (_: uPlot, low: number): uPlot.Range.MinMax => [low - 1, low + 1];
