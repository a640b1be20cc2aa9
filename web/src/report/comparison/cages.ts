import { html } from 'lit';
import { PALE } from '../../render/colorMap';
import type { ChartOptions, Series } from '../../charts/chart';
import type { Comparison, Figure, MethodFigures, Totals } from '../data';
import { familyName, isPaperMethod, methodColor, OTHER_COLORS } from '../methods';
import { caption, charts, colored, colorScale, methodName, table, viewsOf, type Cell } from '../table';
import { percents } from '../text';
import { curves, grouped, inPercent, type ComparisonReport, type SystemReport } from './system';
import { scaleTop } from '../geometry/modelInCage';
import type { Moments, View } from '../views';

export function cages(report: ComparisonReport, system: SystemReport) {
  const { figures } = report;
  const { methods } = system.figures;
  const found = cageViews(report, system);
  const { shown } = figures.capture;
  return html`
    <p>
      A good cage moves as smoothly as the model. The second difference in time, |C(t+1) − 2 C(t) + C(t−1)|, is what the
      eye sees as shaking: its mean over vertices and frames measures how much a cage jitters, its largest value the
      worst spike. The change of the cage's edges against the rest cage measures how far it has lost its shape.
    </p>
    ${viewsOf('Cages of the methods', found)} ${colorScale('0', `${percents(found.top, 2)} % and more`, PALE.gradient)}
    ${caption(
      `Cages around frame ${shown}, coloured by each vertex’s second difference in time.`,
      `Frame ${shown} is that of plain least squares’ largest spike; play the frames before and after it to see the cages shake. All views have the same camera and scale. Spikes that reach far beyond the picture are cut off.`,
      'Paper: Figs. 8, 13, 18, 19 and 20.',
    )}
    ${charts(
      byThreshold(methods, 'Mean spike', 'mean second difference, %', 'spike_mean'),
      byThreshold(methods, 'Largest spike', 'largest second difference, %', 'spike_max'),
      byThreshold(methods, 'Edges', 'mean change of edges, %', 'edges_mean'),
      errorAndJitter(methods, figures.capture.motion_mean),
      {
        title: 'Largest spike of every frame',
        x: { label: 'frame' },
        y: { label: 'largest second difference, %', cover: 'log' },
        series: curves(figures, methods, 'spike_max'),
      },
    )}
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
  value: keyof Totals,
): ChartOptions {
  const largest = Math.max(...methods.map(({ spectrum }) => spectrum));
  const series = ['all', 'maxvol'].flatMap((handles): Series[] => {
    const of = (...regularizers: string[]) =>
      methods.filter((method) => method.handles === handles && regularizers.includes(method.regularizer));
    const name = handles === 'all' ? 'all points' : handles;
    return [
      {
        label: `${name}, sub-spectral`,
        color: methodColor({ handles, regularizer: 'laplacian' }),
        mark: 'line',
        points: of('none', 'laplacian').map(({ spectrum, totals }) => [spectrum, inPercent(totals[value])]),
      },
      ...of('global').map((method) =>
        level(`${name}, global`, methodColor(method), [0, largest], method.totals[value]),
      ),
    ];
  });
  return { title, x: { label: 'spectrum threshold s' }, y: { label, cover: 'around' }, series };
}

function level(label: string, color: string, ends: readonly number[], value: Figure): Series {
  return { label, color, mark: 'dashes', points: ends.map((x) => [x, inPercent(value)]) };
}

function errorAndJitter(methods: readonly MethodFigures[], motion: Figure): ChartOptions {
  const known = methods.filter(({ totals }) => totals.l2_mean !== null);
  const places = known.map(({ totals }) => 100 * totals.l2_mean!);
  const series = grouped(
    known.map((method, k) => ({
      label: familyName(method),
      color: methodColor(method),
      mark: isPaperMethod(method) ? 'squares' : 'dots',
      point: [places[k], inPercent(method.totals.spike_mean)],
    })),
  );
  const ends = [Math.min(...places), Math.max(...places)];
  return {
    title: 'Error and jitter',
    x: { label: 'mean L2, %' },
    y: { label: 'mean second difference, %', cover: 'around' },
    series: places.length > 0 ? [...series, level('the model itself', OTHER_COLORS.plain, ends, motion)] : [],
  };
}

function cageTable(methods: readonly MethodFigures[], { capture }: Comparison) {
  const rows = methods.map((method) => ({ name: methodName(method), ...method.totals }));
  const own = { spike_mean: capture.motion_mean, spike_max: capture.motion_max };
  return table<{ readonly name: Cell } & Partial<Totals>>(
    rows,
    [
      ['method', ({ name }) => name],
      ['mean spike %', (row) => percents(row.spike_mean, 4)],
      ['largest spike %', (row) => percents(row.spike_max, 3)],
      ['edges: mean change %', (row) => percents(row.edges_mean, 2)],
      ['edges: largest %', (row) => percents(row.edges_max, 1)],
      ['mean L2 %', (row) => percents(row.l2_mean, 4)],
    ],
    1,
    [{ name: colored(OTHER_COLORS.plain, 'the model’s own points'), ...own }],
  );
}

/** Frames per second of the clip: slow enough to see single frames. */
const RATE = 6;

/** Cages of the frames around the shown one, coloured by each vertex's second difference in time. */
export function cageViews(
  { rest, figures, geometry }: ComparisonReport,
  system: SystemReport,
): { views: View[]; framed: Float32Array; moments: Moments; top: number } {
  const { clip } = geometry;
  const { shown, measured } = figures.capture;
  const size = rest.cageVertices.length;
  const found = system.geometry.methods.map(({ method, cages }) => {
    const all = rest.placedFrom(cages);
    const frames = clip.map((_, k) => all.subarray(k * size, (k + 1) * size));
    const spikes = frames.map((_, k) => secondDifferences(frames[k - 1], frames[k], frames[k + 1]));
    return { of: system.figures.methods[method], frames, spikes };
  });
  const first = Math.max(0, clip.indexOf(shown));
  const top = scaleTop(found.map(({ spikes }) => spikes[first]));
  const views = found.map(({ of, frames, spikes }): View => {
    const values = spikes.map((spike) => spike.map((value) => value / top));
    const at = measured.indexOf(shown);
    const { spike_mean, spike_max } = of.per_frame;
    return {
      title: of.name,
      note:
        spike_max[at] === null
          ? ''
          : `frame ${shown}: mean ${percents(spike_mean[at], 3)} %, largest ${percents(spike_max[at], 2)} %`,
      color: methodColor(of),
      drawing: (place) => ({
        surface: { positions: frames[place], triangles: rest.cage.triangles, values: values[place], flat: true },
        cage: { mesh: rest.cage, vertices: frames[place] },
      }),
    };
  });
  // Spikes may leave the picture; the cages of the paper's own method, whose strongest one is the smoothest, do not.
  const smoothest =
    found.findLast(({ of }) => of.handles === 'maxvol' && of.regularizer === 'laplacian') ?? found.at(0);
  return {
    views,
    framed: smoothest ? smoothest.frames[first] : rest.cageVertices,
    moments: { count: clip.length, first, rate: RATE, smooth: false, name: (place) => `frame ${clip[place]}` },
    top,
  };
}

/** Length of C(t+1) − 2 C(t) + C(t−1) of each vertex; 0 where a neighbour is missing. */
function secondDifferences(
  before: Float32Array | undefined,
  at: Float32Array,
  after: Float32Array | undefined,
): Float32Array {
  const found = new Float32Array(at.length / 3);
  if (!before || !after) return found;
  for (let i = 0; i < found.length; i++) {
    const bend = (k: number) => before[3 * i + k] - 2 * at[3 * i + k] + after[3 * i + k];
    found[i] = Math.hypot(bend(0), bend(1), bend(2));
  }
  return found;
}
