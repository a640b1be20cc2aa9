import uPlot from 'uplot';

/** Colours as canvases take them, and the font of the labels. */
export interface SpectrumChartLook {
  readonly line: string;
  readonly values: string;
  readonly chosen: string;
  readonly text: string;
  readonly font: string;
}

/** What the chart marks: the chosen value, and from where on directions kept the shape of the rest cage, both from 0. */
export interface SpectrumMarks {
  readonly chosen: number;
  readonly regularised: number;
}

/** Charts singular values on a logarithmic scale over their numbers, which begin at 1. */
export function spectrumChart(
  place: HTMLElement,
  values: Float64Array,
  marks: () => SpectrumMarks,
  look: SpectrumChartLook,
): uPlot {
  const axis = { stroke: look.text, font: look.font, grid: { stroke: look.line, width: 1 }, ticks: { show: false } };
  const options: uPlot.Options = {
    width: Math.max(60, place.clientWidth),
    height: place.clientHeight,
    padding: [8, 10, 0, 0],
    cursor: { show: false },
    legend: { show: false },
    select: { show: false, left: 0, top: 0, width: 0, height: 0 },
    scales: {
      x: { time: false, range: () => [0.5, values.length + 0.5] },
      y: { range: (_, least, most) => [least - 0.2, most + 0.2] },
    },
    axes: [
      { ...axis, size: 20, gap: 3, grid: { show: false }, space: 44, incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500] },
      { ...axis, size: 44, gap: 4, space: 18, incrs: [1, 2, 3, 5], values: (_, splits) => splits.map(powerText) },
    ],
    series: [
      {},
      {
        label: 'σ',
        stroke: look.values,
        width: 1.5,
        points: { show: values.length <= 80, size: 4, fill: look.values },
      },
    ],
    hooks: {
      drawClear: [(chart) => shadeRegularised(chart, marks(), values, look)],
      draw: [(chart) => markChosen(chart, marks(), values, look)],
    },
  };
  const numbers = Array.from(values, (_, k) => k + 1);
  return new uPlot(options, [numbers, Array.from(values, (value) => (value > 0 ? Math.log10(value) : null))], place);
}

/** A power of ten as it is written beside the axis. */
function powerText(exponent: number): string {
  return Math.abs(exponent) < 2.5 ? String(Number((10 ** exponent).toPrecision(1))) : `1e${exponent}`;
}

function shadeRegularised(chart: uPlot, { regularised }: SpectrumMarks, values: Float64Array, look: SpectrumChartLook) {
  if (regularised >= values.length) return;
  const { ctx, bbox } = chart;
  const from = chart.valToPos(regularised + 0.5, 'x', true);
  ctx.save();
  ctx.globalAlpha = 0.14;
  ctx.fillStyle = look.chosen;
  ctx.fillRect(from, bbox.top, bbox.left + bbox.width - from, bbox.height);
  ctx.restore();
}

function markChosen(chart: uPlot, { chosen }: SpectrumMarks, values: Float64Array, look: SpectrumChartLook) {
  const { ctx, bbox } = chart;
  const x = chart.valToPos(chosen + 1, 'x', true);
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = look.chosen;
  ctx.lineWidth = devicePixelRatio;
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  if (values[chosen] > 0) {
    ctx.beginPath();
    ctx.arc(x, chart.valToPos(Math.log10(values[chosen]), 'y', true), 4 * devicePixelRatio, 0, 2 * Math.PI);
    ctx.fill();
  }
  ctx.restore();
}
