import { html } from 'lit';
import type { Cover, Series } from '../../charts/chart';
import type { Figure, SystemFigures } from '../data';
import { methodColor, OTHER_COLORS } from '../methods';
import { caption, charts, colored, table } from '../table';
import { condition, singular } from '../text';
import { ofAll, type ComparisonReport, type SystemReport } from './system';

const MAXVOL_COLOR = methodColor({ handles: 'maxvol', regularizer: 'laplacian' });
const FULL_COLOR = methodColor({ handles: 'all', regularizer: 'none' });

/** Singular values of the chosen system, and a table of all. */
export function spectra({ systems }: ComparisonReport, system: SystemReport) {
  const chart = (title: string, from: number, cover: Cover) => ({
    title,
    x: { label: 'singular value number' },
    y: { label: 'over the largest', cover },
    series: spectraOf(system.figures).map(({ label, color, values }): Series => {
      const points = values.map((sigma, k) => [k + 1, over(sigma, values[0] ?? 1)] as const);
      return { label, color, mark: 'line', points: points.slice(from) };
    }),
  });
  const at = (values: readonly Figure[], part: number) => values[Math.floor((values.length - 1) * part)] ?? null;
  return html`
    ${charts(
      chart('Whole spectrum', 0, 'log'),
      chart('Last fifth', Math.floor((system.figures.unknowns * 4) / 5), 'zero'),
    )}
    ${caption(
      'Singular values over the largest one, for the maxvol handles Φ□, for all points Φ, and for the normal equations ΦᵀΦ.',
      'A perturbation of the capture along a direction is amplified by the inverse of its singular value, so a curve that stays high to the right end means stable cages. The last fifth is where the differences are; each curve’s last value is the inverse of its condition number.',
      'Paper: Figs. 6 and 9.',
    )}
    ${table(
      ofAll(systems, spectraOf),
      [
        ['system', (row) => row.system],
        ['matrix', ({ color, label }) => colored(color, label)],
        ['condition', ({ cond }) => condition(cond)],
        ['σ first', ({ values }) => singular(at(values, 0))],
        ['σ at ¼', ({ values }) => singular(at(values, 0.25))],
        ['σ at ½', ({ values }) => singular(at(values, 0.5))],
        ['σ at ¾', ({ values }) => singular(at(values, 0.75))],
        ['σ last', ({ values }) => singular(at(values, 1))],
        ['last over first', ({ values }) => singular(over(at(values, 1), at(values, 0)))],
      ],
      2,
    )}
  `;
}

function spectraOf({ spectra }: SystemFigures) {
  const { full, handles, condition_handles, condition_full, condition_normal } = spectra;
  const squares = full.map((sigma) => (sigma === null ? null : sigma * sigma));
  return [
    { label: 'Φ□ (maxvol)', color: MAXVOL_COLOR, values: handles, cond: condition_handles },
    { label: 'Φ (all points)', color: FULL_COLOR, values: full, cond: condition_full },
    { label: 'ΦᵀΦ (normal equations)', color: OTHER_COLORS.normal, values: squares, cond: condition_normal },
  ];
}

function over(value: Figure, by: Figure): Figure {
  return value === null || by === null ? null : value / by;
}
