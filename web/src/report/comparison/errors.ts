import { html } from 'lit';
import { PALE } from '../../render/colorMap';
import type { MethodFigures } from '../data';
import { caption, charts, colorScale, folded, methodName, table, viewsOf, type Column } from '../table';
import { percents } from '../text';
import { modelViews, rowViews } from './modelViews';
import { curves, type ComparisonReport, type SystemReport } from './system';

export function errors(report: ComparisonReport, system: SystemReport) {
  const { figures } = report;
  const { shown, measured } = figures.capture;
  const { methods } = system.figures;
  const chart = (measure: 'l2' | 'linf', label: string) => ({
    title: `${label} of every measured frame`,
    x: { label: 'frame' },
    y: { label: `${label}, %`, cover: 'zero' as const },
    series: curves(figures, methods, measure),
  });
  const models = modelViews(report, system);
  return html`
    ${charts(chart('l2', 'L2'), chart('linf', 'L∞'))}
    ${caption(
      'Error of every measured frame, by method.',
      'L2 is the root mean square over the model’s points, L∞ the largest distance of a point, both in percent of the rest diagonal. Lower is better; a method whose curve lies close to “all points, data alone” loses little to what any cage of this system could reach, if the system is linear: with green, whose cages are iterated for, other methods may come lower than it. Dashed lines are regularised over the whole spectrum or damped.',
      'Paper: Figs. 14 and 18.',
    )}
    ${methodTable(methods)} ${viewsOf(`Frame ${shown} as the methods reconstruct it`, models)}
    ${colorScale('0', `${percents(models.top, 2)} % and more`, PALE.gradient)}
    ${caption(
      `Frame ${shown} reconstructed, coloured by the distance of every point from the capture.`,
      'It is the frame in which the cage of plain least squares spikes most. One scale for all views but for the first, whose points were drawn at random and whose errors may be off the scale.',
      'Paper: Figs. 3, 10 and 18.',
    )}
    ${viewsOf('The capture as the paper’s method encodes it', rowViews(report, system))}
    ${caption(
      'The capture as the paper’s method encodes it.',
      'Maxvol handles with sub-spectral regularisation at the usual threshold: the reconstructed model, and its cage around it.',
      'Paper: Fig. 14.',
    )}
    ${folded(
      'Every frame in numbers',
      frameTable(
        methods.filter(({ curve }) => curve),
        measured,
      ),
    )}
  `;
}

function methodTable(methods: readonly MethodFigures[]) {
  const least = Math.min(...methods.map(({ totals }) => totals.l2_mean ?? Infinity));
  const ratio = (l2: number | null) => (l2 === null || least === 0 ? '–' : `${(l2 / least).toFixed(2)} ×`);
  return table(methods, [
    ['method', methodName],
    ['mean L2 %', ({ totals }) => percents(totals.l2_mean, 4)],
    ['largest L2 %', ({ totals }) => percents(totals.l2_max, 4)],
    ['mean L∞ %', ({ totals }) => percents(totals.linf_mean, 3)],
    ['largest L∞ %', ({ totals }) => percents(totals.linf_max, 3)],
    ['mean L2 over the least', ({ totals }) => ratio(totals.l2_mean)],
  ]);
}

function frameTable(methods: readonly MethodFigures[], measured: readonly number[]) {
  const column = ({ name, per_frame: { l2, linf } }: MethodFigures): Column<number> => [
    html`${name}<br />L2 %, L∞ %`,
    (k) => `${percents(l2[k], 3)}, ${percents(linf[k], 2)}`,
  ];
  return table([...measured.keys()], [['frame', (k) => String(measured[k])], ...methods.map(column)], 0);
}
