import { html } from 'lit';
import { paleGradient } from '../../render/colorMap';
import type { ChartOptions, Series } from '../chart';
import type { Comparison, Figure, MethodFigures, SystemFigures } from '../data';
import { familyName, isDashed, isPaperMethod, methodColor, OTHER_COLORS } from '../methods';
import { caption, colored, colorScale, methodName, table } from '../table';
import { percents } from '../text';
import { cageViews } from './cageViews';
import { inPercent, overFrames, type ComparisonReport, type SystemReport } from './system';

/** Stability of the cages: spikes and edges, per method and threshold. */
export function cages(report: ComparisonReport, system: SystemReport) {
  const { figures } = report;
  const { methods } = system.figures;
  const charts: readonly ChartOptions[] = [
    byThreshold(methods, 'Mean spike', 'mean second difference, %', (m) => m.totals.spike_mean),
    byThreshold(methods, 'Largest spike', 'largest second difference, %', (m) => m.totals.spike_max),
    byThreshold(methods, 'Edges', 'mean change of edges, %', (m) => m.totals.edges_mean),
    errorAndJitter(methods, figures.capture.motion_mean),
    spikesOverTime(system.figures, figures),
  ];
  const found = cageViews(report, system);
  const { shown } = figures.capture;
  return html`
    <p>
      A good cage moves as smoothly as the model. The second difference in time, |C(t+1) − 2 C(t) + C(t−1)|, is what the
      eye sees as shaking: its mean over vertices and frames measures how much a cage jitters, its largest value the
      worst spike. The change of the cage's edges against the rest cage measures how far it has lost its shape.
    </p>
    <report-views
      .views=${found.views}
      .framed=${found.framed}
      .moments=${found.moments}
      label="Cages of the methods"
    ></report-views>
    ${colorScale('0', `${percents(found.top, 2)} % and more`, paleGradient())}
    ${caption(
      `Cages around frame ${shown}, coloured by each vertex’s second difference in time.`,
      `Frame ${shown} is that of plain least squares’ largest spike; play the frames before and after it to see the cages shake. All views have the same camera and scale. Spikes that reach far beyond the picture are cut off.`,
      'Paper: Figs. 8, 13, 18, 19 and 20.',
    )}
    <div class="charts">${charts.map((options) => html`<report-chart .options=${options}></report-chart>`)}</div>
    ${caption(
      'How smoothly the cages move, and what it costs.',
      'The first three over the spectrum threshold s, for every choice of points read; global regularisation has no threshold and is a level line. Then every method by its error and its jitter, both better towards the lower left corner, with the model’s own mean as a line; and the largest spike of every frame. Axes need not begin at zero.',
      'Paper: Figs. 8, 12, 13, 19 and 20.',
    )}
    ${cageTable(methods, figures)}
  `;
}

function byThreshold(
  methods: readonly MethodFigures[],
  title: string,
  label: string,
  value: (method: MethodFigures) => Figure,
): ChartOptions {
  const largest = Math.max(...methods.map(({ spectrum }) => spectrum));
  const series = ['all', 'maxvol'].flatMap((handles): Series[] => {
    const here = methods.filter((method) => method.handles === handles);
    const local = here.filter(({ regularizer }) => regularizer === 'none' || regularizer === 'laplacian');
    const global = here.filter(({ regularizer }) => regularizer === 'global');
    const name = handles === 'all' ? 'all points' : handles;
    return [
      {
        label: `${name}, sub-spectral`,
        color: methodColor({ handles, regularizer: 'laplacian' }),
        mark: 'line',
        points: local.map((method) => [method.spectrum, inPercent(value(method))]),
      },
      ...global.map((method): Series => {
        const level = inPercent(value(method));
        return {
          label: `${name}, global`,
          color: methodColor(method),
          mark: 'dashes',
          points: [
            [0, level],
            [largest, level],
          ],
        };
      }),
    ];
  });
  return { title, x: { label: 'spectrum threshold s' }, y: { label, cover: 'around' }, series };
}

function errorAndJitter(methods: readonly MethodFigures[], motion: Figure): ChartOptions {
  const series = new Map<string, Series>();
  for (const method of methods) {
    const { l2_mean, spike_mean } = method.totals;
    if (l2_mean === null) continue;
    const label = familyName(method);
    const before = series.get(label)?.points ?? [];
    const mark = isPaperMethod(method) ? 'diamonds' : 'dots';
    series.set(label, {
      label,
      color: methodColor(method),
      mark,
      points: [...before, [100 * l2_mean, inPercent(spike_mean)]],
    });
  }
  const places = [...series.values()].flatMap(({ points }) => points.map(([x]) => x));
  const level = inPercent(motion);
  const line: Series = {
    label: 'the model itself',
    color: OTHER_COLORS.plain,
    mark: 'dashes',
    points: [
      [Math.min(...places), level],
      [Math.max(...places), level],
    ],
  };
  return {
    title: 'Error and jitter',
    x: { label: 'mean L2, %' },
    y: { label: 'mean second difference, %', cover: 'around' },
    series: places.length > 0 ? [...series.values(), line] : [],
  };
}

function spikesOverTime({ methods }: SystemFigures, figures: Comparison): ChartOptions {
  return {
    title: 'Largest spike of every frame',
    x: { label: 'frame' },
    y: { label: 'largest second difference, %', cover: 'log' },
    series: methods
      .filter(({ curve }) => curve)
      .map((method) => ({
        label: method.name,
        color: methodColor(method),
        mark: isDashed(method) ? 'dashes' : 'line',
        points: overFrames(figures, method.per_frame.spike_max),
      })),
  };
}

function cageTable(methods: readonly MethodFigures[], { capture }: Comparison) {
  return table(
    ['method', 'mean spike %', 'largest spike %', 'edges: mean change %', 'edges: largest %', 'mean L2 %'],
    1,
    methods.map((method) => {
      const { spike_mean, spike_max, edges_mean, edges_max, l2_mean } = method.totals;
      return [
        methodName(method),
        percents(spike_mean, 4),
        percents(spike_max, 3),
        percents(edges_mean, 2),
        percents(edges_max, 1),
        percents(l2_mean, 4),
      ];
    }),
    [
      [
        colored(OTHER_COLORS.plain, 'the model’s own points'),
        percents(capture.motion_mean, 4),
        percents(capture.motion_max, 3),
        '–',
        '–',
        '–',
      ],
    ],
  );
}
