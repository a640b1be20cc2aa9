import { html } from 'lit';
import type { Series } from '../chart';
import type { Method, SystemFigures } from '../data';
import { isPaperMethod, methodColor } from '../methods';
import { caption, methodName, table } from '../table';
import { percents } from '../text';
import { overFrames, type ComparisonReport, type SystemReport } from './system';

/** The noise test. */
export function noise({ figures, systems }: ComparisonReport, system: SystemReport) {
  const radius = percents(figures.capture.noise_radius, 1);
  const series = system.figures.noise
    .filter((noisy) => isPaperMethod(noisy) || (noisy.handles === 'all' && noisy.regularizer === 'none'))
    .flatMap((noisy): Series[] => {
      const color = methodColor(noisy);
      const clean = withoutNoise(system.figures, noisy);
      return [
        { label: `${noisy.name}, noise`, color, mark: 'line', points: overFrames(figures, noisy.per_frame.linf) },
        ...(clean
          ? [{ label: noisy.name, color, mark: 'dashes' as const, points: overFrames(figures, clean.per_frame.linf) }]
          : []),
      ];
    });
  return html`
    <div class="charts">
      <report-chart
        .options=${{ title: 'L∞ with and without noise', x: { label: 'frame' }, y: { label: 'L∞, %', cover: 'zero' }, series }}
      ></report-chart>
    </div>
    ${caption(
      `L∞ of every frame with and without noise of ${radius} %.`,
      `Every point of every frame is displaced at random, evenly within a ball whose radius is ${radius} % of the rest diagonal. Solid lines: error against the noisy capture, as in the paper; dashed: the capture as it is. The curves should keep their course and rise by about the radius.`,
      'Paper: Fig. 16.',
    )}
    ${table(
      [
        'system',
        'method',
        'mean L2 %',
        'without',
        'largest L∞ %',
        'without',
        'rise',
        'mean L2 to clean %',
        'mean spike %',
        'without',
      ],
      2,
      systems.flatMap((one) =>
        one.figures.noise.flatMap((noisy) => {
          const clean = withoutNoise(one.figures, noisy)?.totals;
          if (!clean) return [];
          const { totals } = noisy;
          const rise = totals.linf_max !== null && clean.linf_max !== null ? totals.linf_max - clean.linf_max : null;
          return [
            [
              one.name,
              methodName(noisy),
              percents(totals.l2_mean, 4),
              percents(clean.l2_mean, 4),
              percents(totals.linf_max, 3),
              percents(clean.linf_max, 3),
              percents(rise, 3),
              percents(noisy.clean_l2_mean, 4),
              percents(totals.spike_mean, 4),
              percents(clean.spike_mean, 4),
            ],
          ];
        }),
      ),
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
