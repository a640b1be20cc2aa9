import { html } from 'lit';
import type { Series } from '../../charts/chart';
import type { Method, SystemFigures } from '../data';
import { isPaperMethod, methodColor } from '../methods';
import { caption, charts, methodName, table } from '../table';
import { percents } from '../text';
import { ofAll, overFrames, type ComparisonReport, type SystemReport } from './system';

export function noise({ figures, systems }: ComparisonReport, system: SystemReport) {
  const radius = percents(figures.capture.noise_radius, 1);
  const series = system.figures.noise
    .filter((noisy) => isPaperMethod(noisy) || (noisy.handles === 'all' && noisy.regularizer === 'none'))
    .flatMap((noisy): Series[] => {
      const clean = withoutNoise(system.figures, noisy);
      const line = (label: string, mark: Series['mark'], of: typeof noisy.per_frame): Series => ({
        ...{ label, mark, color: methodColor(noisy) },
        points: overFrames(figures, of.linf),
      });
      const own = line(`${noisy.name}, noise`, 'line', noisy.per_frame);
      return clean ? [own, line(noisy.name, 'dashes', clean.per_frame)] : [own];
    });
  const rise = (noisy: number | null, clean: number | null) =>
    noisy === null || clean === null ? null : noisy - clean;
  return html`
    ${charts({ title: 'L∞ with and without noise', x: { label: 'frame' }, y: { label: 'L∞, %', cover: 'zero' }, series })}
    ${caption(
      `L∞ of every frame with and without noise of ${radius} %.`,
      `Every point of every frame is displaced at random, evenly within a ball whose radius is ${radius} % of the rest diagonal. Solid lines: error against the noisy capture, as in the paper; dashed: the capture as it is. The curves should keep their course and rise by about the radius.`,
      'Paper: Fig. 16.',
    )}
    ${table(
      ofAll(systems, (of) =>
        of.noise.flatMap((noisy) => {
          const clean = withoutNoise(of, noisy)?.totals;
          return clean ? [{ noisy, totals: noisy.totals, clean }] : [];
        }),
      ),
      [
        ['system', (row) => row.system],
        ['method', ({ noisy }) => methodName(noisy)],
        ['mean L2 %', ({ totals }) => percents(totals.l2_mean, 4)],
        ['without', ({ clean }) => percents(clean.l2_mean, 4)],
        ['largest L∞ %', ({ totals }) => percents(totals.linf_max, 3)],
        ['without', ({ clean }) => percents(clean.linf_max, 3)],
        ['rise', ({ totals, clean }) => percents(rise(totals.linf_max, clean.linf_max), 3)],
        ['mean L2 to clean %', ({ noisy }) => percents(noisy.clean_l2_mean, 4)],
        ['mean spike %', ({ totals }) => percents(totals.spike_mean, 4)],
        ['without', ({ clean }) => percents(clean.spike_mean, 4)],
      ],
      2,
    )}
    <p class="caption">
      “To clean” is the error against the capture without noise: where it is below the error against the noisy one, the
      cage has filtered noise out.
    </p>
  `;
}

function withoutNoise({ methods }: SystemFigures, { name }: Method) {
  return methods.find((method) => method.name === name);
}
