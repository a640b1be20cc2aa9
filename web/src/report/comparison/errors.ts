import { html } from 'lit';
import { paleGradient } from '../../render/colorMap';
import type { MethodFigures } from '../data';
import { isDashed, methodColor } from '../methods';
import { caption, colorScale, folded, methodName, table } from '../table';
import { percents } from '../text';
import { modelViews, rowViews } from './modelViews';
import { overFrames, type ComparisonReport, type SystemReport } from './system';

/** Errors of the reconstructed model, by method. */
export function errors(report: ComparisonReport, system: SystemReport) {
  const { figures } = report;
  const curves = system.figures.methods.filter((method) => method.curve);
  const chart = (measure: 'l2' | 'linf', label: string) =>
    html`<report-chart
      .options=${{
        title: `${label} of every measured frame`,
        x: { label: 'frame' },
        y: { label: `${label}, %`, cover: 'zero' },
        series: curves.map((method) => ({
          label: method.name,
          color: methodColor(method),
          mark: isDashed(method) ? 'dashes' : 'line',
          points: overFrames(figures, method.per_frame[measure]),
        })),
      }}
    ></report-chart>`;
  const models = modelViews(report, system);
  const row = rowViews(report, system);
  return html`
    <div class="charts">${chart('l2', 'L2')} ${chart('linf', 'L∞')}</div>
    ${caption(
      'Error of every measured frame, by method.',
      'L2 is the root mean square over the model’s points, L∞ the largest distance of a point, both in percent of the rest diagonal. Lower is better; a method whose curve lies close to “all points, data alone” loses little to what any cage of this system could reach, if the system is linear: with green, whose cages are iterated for, other methods may come lower than it. Dashed lines are regularised over the whole spectrum or damped.',
      'Paper: Figs. 14 and 18.',
    )}
    ${methodTable(system.figures.methods)}
    <report-views
      .views=${models.views}
      .framed=${models.framed}
      label="Frame ${figures.capture.shown} as the methods reconstruct it"
    ></report-views>
    ${colorScale('0', `${percents(models.top, 2)} % and more`, paleGradient())}
    ${caption(
      `Frame ${figures.capture.shown} reconstructed, coloured by the distance of every point from the capture.`,
      'It is the frame in which the cage of plain least squares spikes most. One scale for all views but for the first, whose points were drawn at random and whose errors may be off the scale.',
      'Paper: Figs. 3, 10 and 18.',
    )}
    <report-views
      .views=${row.views}
      .framed=${row.framed}
      label="The capture as the paper’s method encodes it"
    ></report-views>
    ${caption(
      'The capture as the paper’s method encodes it.',
      'Maxvol handles with sub-spectral regularisation at the usual threshold: the reconstructed model, and its cage around it.',
      'Paper: Fig. 14.',
    )}
    ${folded('Every frame in numbers', frameTable(curves, figures.capture.measured))}
  `;
}

function methodTable(methods: readonly MethodFigures[]) {
  const least = Math.min(...methods.map(({ totals }) => totals.l2_mean ?? Infinity));
  return table(
    ['method', 'mean L2 %', 'largest L2 %', 'mean L∞ %', 'largest L∞ %', 'mean L2 over the least'],
    1,
    methods.map((method) => {
      const { l2_mean, l2_max, linf_mean, linf_max } = method.totals;
      const ratio = l2_mean === null || least === 0 ? '–' : `${(l2_mean / least).toFixed(2)} ×`;
      return [
        methodName(method),
        percents(l2_mean, 4),
        percents(l2_max, 4),
        percents(linf_mean, 3),
        percents(linf_max, 3),
        ratio,
      ];
    }),
  );
}

function frameTable(methods: readonly MethodFigures[], measured: readonly number[]) {
  return table(
    ['frame', ...methods.map((method) => html`${method.name}<br />L2 %, L∞ %`)],
    0,
    measured.map((frame, k) => [
      String(frame),
      ...methods.map(({ per_frame: { l2, linf } }) => `${percents(l2[k], 3)}, ${percents(linf[k], 2)}`),
    ]),
  );
}
