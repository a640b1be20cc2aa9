import { html, svg } from 'lit';
import { fraction } from '../sessions/text';
import type { Measured } from './uploadJob';

const WIDTH = 640;
const HEIGHT = 120;
/** Columns of the chart; longer captures are shown by the worst of the frames that share one. */
const COLUMNS = 320;

/** Errors of the frames so far, as two lines over the frame number: the mean error of each frame's points, and its worst point. */
export function errorChart(measured: Measured) {
  const [l2, linf] = [columns(measured.l2), columns(measured.linf)];
  const top = Math.max(...linf.filter((value) => !Number.isNaN(value)), 0);
  if (top === 0) return html``;
  const label = `Errors of the frames so far: the worst point is ${fraction(top)} of the diagonal off`;
  return html`
    <figure class="errors">
      <figcaption>
        <span class="key worst"></span>Worst point <span class="key mean"></span>Mean of the points
        <span class="scale figures">up to ${fraction(top)} of the diagonal</span>
      </figcaption>
      <svg viewBox="0 0 ${WIDTH} ${HEIGHT}" preserveAspectRatio="none" role="img" aria-label=${label}>
        ${svg`<path class="worst" d=${path(linf, top)} /><path class="mean" d=${path(l2, top)} />`}
      </svg>
    </figure>
  `;
}

/** The largest value of each column; NaN where nothing is known of it. */
function columns(values: Float32Array): number[] {
  const count = Math.min(COLUMNS, values.length);
  const out = new Array<number>(count).fill(Number.NaN);
  values.forEach((value, frame) => {
    const at = Math.floor((frame * count) / values.length);
    if (!(out[at] >= value) && !Number.isNaN(value)) out[at] = value;
  });
  return out;
}

function path(values: readonly number[], top: number): string {
  let isDrawing = false;
  return values
    .map((value, i) => {
      if (Number.isNaN(value)) {
        isDrawing = false;
        return '';
      }
      const x = (WIDTH * (i + 0.5)) / values.length;
      const y = HEIGHT - 3 - ((HEIGHT - 6) * value) / top;
      const step = `${isDrawing ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`;
      // A frame alone is a dot.
      const dot = isDrawing ? '' : 'h0.01';
      isDrawing = true;
      return step + dot;
    })
    .join('');
}
