import { html } from 'lit';
import type { Point, Series } from '../../charts/chart';
import type { Figure, SwapTrace, SystemFigures } from '../data';
import { floats } from '../geometry/numbers';
import { methodColor, OTHER_COLORS } from '../methods';
import { caption, charts, colored, table, viewsOf } from '../table';
import { anyPercents, condition, decimals, percents } from '../text';
import { grouped, inPercent, methodOf, ofAll, type ComparisonReport, type SystemReport } from './system';

/** Frames at which draws are measured where every inversion iterates (`DRAW_FRAMES` of the program). */
const DRAW_FRAMES = 6;
const LU_COLOR = methodColor({ handles: 'maxvol', regularizer: 'laplacian' });
const DRAWN_COLOR = methodColor({ handles: 'all', regularizer: 'none' });

/** Volume and condition number over the swaps of maxvol, and the handles that it finds. */
export function swaps({ systems, rest }: ComparisonReport, system: SystemReport) {
  const handles = rest.placed(floats(system.geometry.handles));
  const drawing = {
    surface: { positions: rest.points, triangles: rest.triangles },
    cage: { mesh: rest.cage, vertices: rest.cageVertices },
    marks: { positions: handles, through: false },
  };
  const note = `${handles.length / 3} points of maximum volume`;
  const views = [{ title: 'Handles', note, drawing: () => drawing }];
  const chart = (title: string, label: string, cover: 'around' | 'log', points: (trace: SwapTrace) => Point[]) => ({
    title,
    x: { label: 'swaps' },
    y: { label, cover },
    series: tracesOf(system.figures).map(({ name, color, trace }): Series => ({
      label: `from ${name}`,
      color,
      mark: 'line',
      points: points(trace),
    })),
  });
  return html`
    ${charts(
      chart('Volume', 'ln |det Φ□|', 'around', ({ log_volume }) => log_volume.map((volume, k) => [k, volume])),
      chart('Condition number', 'condition number of Φ□', 'log', (trace) =>
        trace.after.map((k, at) => [k, trace.condition[at]]),
      ),
    )}
    ${caption(
      'Volume and condition number of the handles’ matrix Φ□ after every swap.',
      'The search starts from the rows that LU with partial pivoting picks, which is close to the end, or from those that LU picks among a few points drawn at random, which is farther away, as the paper’s start is. Each swap multiplies the volume by the entry of B that called for it; it ends where no entry exceeds 1.01, or 2 from 1,536 columns on. Volume should only rise; the condition number need not fall at each swap, but does in the long run.',
      'Paper: Fig. 4.',
    )}
    ${table(
      ofAll(systems, tracesOf),
      [
        ['system', (row) => row.system],
        ['start', ({ color, name }) => colored(color, name)],
        ['points', ({ trace }) => String(trace.points)],
        ['swaps', ({ trace }) => String(trace.log_volume.length - 1)],
        ['ln volume first', ({ trace }) => decimals(trace.log_volume[0], 2)],
        ['last', ({ trace }) => decimals(trace.log_volume.at(-1), 2)],
        ['condition first', ({ trace }) => condition(trace.condition[0])],
        ['last', ({ trace }) => condition(trace.condition.at(-1))],
      ],
      2,
    )}
    ${viewsOf('Handles on the rest pose', { views, framed: rest.cageVertices }, 'wide-view')}
    ${caption(
      'The handles on the rest pose in its cage.',
      'They gather where the cage is fine and at what sticks out: fingertips, ears, edges.',
      'Paper: Figs. 4, 7 and 9.',
    )}
  `;
}

function tracesOf({ swaps }: SystemFigures) {
  const lu = { name: 'pivoted LU', color: LU_COLOR, trace: swaps.from_lu };
  const drawn = { name: 'LU of a few drawn points', color: DRAWN_COLOR, trace: swaps.from_random };
  return [lu, drawn].flatMap(({ trace, ...of }) => (trace ? [{ ...of, trace }] : []));
}

export function random({ systems }: ComparisonReport, system: SystemReport) {
  const known = choicesOf(system.figures).filter(({ cond }) => cond !== null);
  return html`
    ${charts({
      title: 'Error and condition number',
      x: { label: 'condition number', cover: 'log' },
      y: { label: 'mean L2, %', cover: 'log' },
      series: grouped(
        known.map(({ label, mark, color, cond, totals }) => ({
          ...{ label, mark, color },
          point: [cond!, inPercent(totals.l2_mean)],
        })),
      ),
    })}
    ${caption(
      'Ten draws of as many points as unknowns, the rows maxvol starts from, maxvol, and all points, each with sub-spectral regularisation at the usual threshold.',
      `One dot for each choice of handles: to the right the less stable, upwards the less accurate ones. Points drawn at random often lie so close together that their rows are dependent; without regularisation they reconstruct nothing at all (last column). What a draw looks like is the first view under “Errors of the reconstructed model”. With green coordinates, where every inversion iterates, the draws and the start of maxvol are measured at ${DRAW_FRAMES} frames only.`,
      'Paper: Fig. 3.',
    )}
    ${table(
      ofAll(systems, choicesOf),
      [
        ['system', (row) => row.system],
        ['handles', ({ color, name }) => colored(color, name)],
        ['rank', ({ rank }) => String(rank)],
        ['condition', ({ cond }) => condition(cond)],
        ['mean L2 %', ({ totals }) => percents(totals.l2_mean, 4)],
        ['largest L∞ %', ({ totals }) => percents(totals.linf_max, 2)],
        ['mean spike %', ({ totals }) => percents(totals.spike_mean, 4)],
        ['data alone: mean L2 %', ({ alone }) => anyPercents(alone.l2_mean)],
      ],
      2,
    )}
  `;
}

/** Draws, the start of maxvol, and the usual method with the handles of maxvol and with all points. */
function choicesOf(figures: SystemFigures) {
  const draws = figures.random.map(({ choice: name, rank, condition: cond, totals, data_alone: alone }) => {
    const look = name.startsWith('random')
      ? { color: OTHER_COLORS.plain, label: 'drawn at random' }
      : { color: methodColor({ handles: 'maxvol', regularizer: 'none' }), label: 'start of maxvol (LU)' };
    return { name, ...look, mark: 'dots' as const, rank, cond, totals, alone };
  });
  const whole = (handles: string, name: string, color: string, cond: Figure) => {
    const [usual, alone] = ['laplacian', 'none'].map((regularizer) => methodOf(figures, handles, regularizer)?.totals);
    const { rank } = figures;
    return usual && alone
      ? [{ name, label: name, mark: 'squares' as const, color, rank, cond, totals: usual, alone }]
      : [];
  };
  const { condition_handles, condition_full } = figures.spectra;
  return [
    ...draws,
    ...whole('maxvol', 'maxvol', LU_COLOR, condition_handles),
    ...whole('all', 'all points', DRAWN_COLOR, condition_full),
  ];
}
