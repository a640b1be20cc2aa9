import uPlot from 'uplot';
import { percent } from './text';

/** Least space for the labels of the axis, and space between them and the chart. */
const [MIN_GUTTER, GAP] = [46, 4];
const DASHES = [5, 3];

/** Colours as canvases take them, the font of the labels, and the space right of the chart. */
export interface ChartLook {
  readonly worst: string;
  readonly mean: string;
  readonly text: string;
  readonly line: string;
  readonly font: string;
  readonly margin: number;
}

/**
 * Charts L∞ and L2 of frames that lie at 0 to 1, then those of a second capture, dashed.
 *
 * @param onDraw hears the width of the space for the labels whenever the chart is drawn
 */
export function errorsChart(
  place: HTMLElement,
  data: uPlot.AlignedData,
  { worst, mean, text, line, font, margin }: ChartLook,
  onDraw: (gutter: number) => void,
): uPlot {
  let gutter = MIN_GUTTER;
  const options: uPlot.Options = {
    hooks: { draw: [() => onDraw(gutter)] },
    width: Math.max(60, place.clientWidth),
    height: place.clientHeight,
    padding: [6, margin, 8, 0],
    cursor: { show: false },
    legend: { show: false },
    select: { show: false, left: 0, top: 0, width: 0, height: 0 },
    scales: {
      x: { time: false, range: () => [0, 1] },
      y: { range: (_, __, most) => [0, Math.max(most * 1.08, 1e-9)] },
    },
    axes: [
      { show: false },
      {
        size: (_, labels) => (gutter = gutterFor(labels, font)),
        gap: GAP,
        stroke: text,
        font,
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
      { label: 'L∞ beside', stroke: worst, width: 1.25, dash: DASHES, points: { show: false } },
      { label: 'L2 beside', stroke: mean, width: 1.5, dash: DASHES, points: { show: false } },
    ],
  };
  return new uPlot(options, data, place);
}

/** The width of the longest label, and what keeps it off the chart. */
function gutterFor(labels: readonly string[] | null, font: string): number {
  const context = document.createElement('canvas').getContext('2d');
  if (!context || !labels) return MIN_GUTTER;
  context.font = font;
  return Math.max(MIN_GUTTER, ...labels.map((label) => Math.ceil(context.measureText(label).width) + 2 * GAP));
}

function withOpacity(color: string, opacity: number): string {
  return color.replace(/^rgb\((.*)\)$/, (_, channels: string) => `rgb(${channels.replaceAll(',', ' ')} / ${opacity})`);
}
