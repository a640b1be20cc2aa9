import { html } from 'lit';
import { axisOf } from '../charts/axis';
import { plot, thinned, type Series } from '../charts/plot';
import { percent } from '../text';
import type { Measured } from './uploadJob';

/** Errors of the frames so far, as two lines over the frame number: the mean error of each frame's points, and its worst point. */
export function errorChart(measured: Measured) {
  const top = measured.linf.reduce((most, value) => (value > most ? value : most), 0);
  if (top === 0) return html``;
  const series = (values: Float32Array, color: string): Series => ({
    label: '',
    color: `var(--cager-${color})`,
    mark: 'line',
    points: thinned(values, (frame) => (frame + 0.5) / values.length),
  });
  const lines = [series(measured.linf, 'cage'), series(measured.l2, 'accent')];
  return html`
    <figure class="errors">
      <figcaption class="row fine">
        <span class="key linf"></span>Worst point <span class="key"></span>RMS of all points
        <span class="scale figures">up to ${percent(top, 2)} of the diagonal</span>
      </figcaption>
      <div
        class="area"
        role="img"
        aria-label="Errors of the frames so far: worst point ${percent(top, 2)} of the diagonal"
      >
        ${plot({ x: axisOf([0, 1], 0), y: axisOf([0, 1.05 * top], 0), series: lines })}
      </div>
    </figure>
  `;
}
