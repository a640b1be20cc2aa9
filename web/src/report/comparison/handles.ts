import { html } from 'lit';
import type { Series } from '../chart';
import type { SwapTrace } from '../data';
import { floats } from '../geometry/numbers';
import { methodColor, OTHER_COLORS } from '../methods';
import { caption, colored, table } from '../table';
import { anyPercents, condition, decimals, percents } from '../text';
import type { View } from '../views';
import { inPercent, type ComparisonReport, type SystemReport } from './system';

/** Frames at which draws are measured where every inversion iterates (`DRAW_FRAMES` of the program). */
const DRAW_FRAMES = 6;
const LU_COLOR = methodColor({ handles: 'maxvol', regularizer: 'laplacian' });
const DRAWN_COLOR = methodColor({ handles: 'all', regularizer: 'none' });

/** Volume and condition number over the swaps of maxvol, and the handles that it finds. */
export function swaps({ systems, rest }: ComparisonReport, system: SystemReport) {
  const traces = tracesOf(system);
  const handles = rest.placed(floats(system.geometry.handles));
  const model = { positions: rest.points, triangles: rest.triangles };
  const views: readonly View[] = [
    {
      title: 'Handles',
      note: `${handles.length / 3} points of maximum volume`,
      drawing: () => ({
        surface: model,
        cage: { mesh: rest.cage, vertices: rest.cageVertices },
        marks: { positions: handles, through: false },
      }),
    },
  ];
  const chart = (
    title: string,
    label: string,
    cover: 'around' | 'log',
    points: (trace: SwapTrace) => Series['points'],
  ) =>
    html`<report-chart
      .options=${{
        title,
        x: { label: 'swaps' },
        y: { label, cover },
        series: traces.map(({ name, color, trace }) => ({
          label: `from ${name}`,
          color,
          mark: 'line',
          points: points(trace),
        })),
      }}
    ></report-chart>`;
  return html`
    <div class="charts">
      ${chart('Volume', 'ln |det Φ□|', 'around', ({ log_volume }) => log_volume.map((volume, k) => [k, volume]))}
      ${chart('Condition number', 'condition number of Φ□', 'log', (trace) => trace.after.map((k, at) => [k, trace.condition[at]]))}
    </div>
    ${caption(
      'Volume and condition number of the handles’ matrix Φ□ after every swap.',
      'The search starts from the rows that LU with partial pivoting picks, which is close to the end, or from those that LU picks among a few points drawn at random, which is farther away, as the paper’s start is. Each swap multiplies the volume by the entry of B that called for it; it ends where no entry exceeds 1.01, or 2 from 1,536 columns on. Volume should only rise; the condition number need not fall at each swap, but does in the long run.',
      'Paper: Fig. 4.',
    )}
    ${table(
      ['system', 'start', 'points', 'swaps', 'ln volume first', 'last', 'condition first', 'last'],
      2,
      systems.flatMap((one) =>
        tracesOf(one).map(({ name, color, trace }) => [
          one.name,
          colored(color, name),
          String(trace.points),
          String(trace.log_volume.length - 1),
          decimals(trace.log_volume[0] ?? null, 2),
          decimals(trace.log_volume.at(-1) ?? null, 2),
          condition(trace.condition[0] ?? null),
          condition(trace.condition.at(-1) ?? null),
        ]),
      ),
    )}
    <report-views
      class="wide-view"
      .views=${views}
      .framed=${rest.cageVertices}
      label="Handles on the rest pose"
    ></report-views>
    ${caption(
      'The handles on the rest pose in its cage.',
      'They gather where the cage is fine and at what sticks out: fingertips, ears, edges.',
      'Paper: Figs. 4, 7 and 9.',
    )}
  `;
}

function tracesOf({ figures: { swaps } }: SystemReport) {
  const lu = { name: 'pivoted LU', color: LU_COLOR, trace: swaps.from_lu };
  return swaps.from_random
    ? [lu, { name: 'LU of a few drawn points', color: DRAWN_COLOR, trace: swaps.from_random }]
    : [lu];
}

/** Random handles against those of maximum volume. */
export function random({ systems }: ComparisonReport, system: SystemReport) {
  return html`
    <div class="charts">
      <report-chart
        .options=${{
          title: 'Error and condition number',
          x: { label: 'condition number', cover: 'log' },
          y: { label: 'mean L2, %', cover: 'log' },
          series: randomSeries(system),
        }}
      ></report-chart>
    </div>
    ${caption(
      'Ten draws of as many points as unknowns, the rows maxvol starts from, maxvol, and all points, each with sub-spectral regularisation at the usual threshold.',
      `One dot for each choice of handles: to the right the less stable, upwards the less accurate ones. Points drawn at random often lie so close together that their rows are dependent; without regularisation they reconstruct nothing at all (last column). What a draw looks like is the first view under “Errors of the reconstructed model”. With green coordinates, where every inversion iterates, the draws and the start of maxvol are measured at ${DRAW_FRAMES} frames only.`,
      'Paper: Fig. 3.',
    )}
    ${table(
      ['system', 'handles', 'rank', 'condition', 'mean L2 %', 'largest L∞ %', 'mean spike %', 'data alone: mean L2 %'],
      2,
      systems.flatMap((one) =>
        choicesOf(one).map(({ name, color, rank, condition: of, totals, alone }) => [
          one.name,
          colored(color, name),
          String(rank),
          condition(of),
          percents(totals.l2_mean, 4),
          percents(totals.linf_max, 2),
          percents(totals.spike_mean, 4),
          anyPercents(alone.l2_mean),
        ]),
      ),
    )}
  `;
}

/** Draws, the start of maxvol, and the usual method with the handles of maxvol and with all points. */
function choicesOf({ figures }: SystemReport) {
  const draws = figures.random.map(({ choice, rank, condition: of, totals, data_alone }) => {
    const isDrawn = choice.startsWith('random');
    const color = isDrawn ? OTHER_COLORS.plain : methodColor({ handles: 'maxvol', regularizer: 'none' });
    const series = isDrawn ? 'drawn at random' : 'start of maxvol (LU)';
    return { name: choice, series, mark: 'dots' as const, color, rank, condition: of, totals, alone: data_alone };
  });
  const { condition_handles, condition_full } = figures.spectra;
  const whole = [
    { handles: 'maxvol', name: 'maxvol', color: LU_COLOR, condition: condition_handles },
    { handles: 'all', name: 'all points', color: DRAWN_COLOR, condition: condition_full },
  ].flatMap(({ handles, name, color, condition: of }) => {
    const found = (regularizer: string) =>
      figures.methods.find((m) => m.handles === handles && m.regularizer === regularizer && m.curve);
    const [usual, alone] = [found('laplacian'), found('none')];
    if (!usual || !alone) return [];
    const { rank } = figures;
    return [
      {
        name,
        series: name,
        mark: 'diamonds' as const,
        color,
        rank,
        condition: of,
        totals: usual.totals,
        alone: alone.totals,
      },
    ];
  });
  return [...draws, ...whole];
}

function randomSeries(system: SystemReport): Series[] {
  const series = new Map<string, Series>();
  for (const { series: label, mark, color, condition: x, totals } of choicesOf(system)) {
    if (x === null) continue;
    const before = series.get(label)?.points ?? [];
    series.set(label, { label, color, mark, points: [...before, [x, inPercent(totals.l2_mean)]] });
  }
  return [...series.values()];
}
