import { html } from 'lit';
import type { Cover, Point } from '../chart';
import type { Figure } from '../data';
import { methodColor, OTHER_COLORS } from '../methods';
import { caption, colored, table } from '../table';
import { condition, singular } from '../text';
import type { ComparisonReport, SystemReport } from './system';

interface Spectrum {
  readonly label: string;
  readonly color: string;
  readonly values: readonly Figure[];
  readonly condition: Figure;
}

/** Singular values of the chosen system, and a table of all. */
export function spectra({ systems }: ComparisonReport, system: SystemReport) {
  const found = spectraOf(system);
  const chart = (title: string, from: number, cover: Cover) =>
    html`<report-chart
      .options=${{
        title,
        x: { label: 'singular value number' },
        y: { label: 'over the largest', cover },
        series: found.map(({ label, color, values }) => ({ label, color, mark: 'line', points: scaled(values, from) })),
      }}
    ></report-chart>`;
  return html`
    <div class="charts">
      ${chart('Whole spectrum', 0, 'log')} ${chart('Last fifth', Math.floor((system.figures.unknowns * 4) / 5), 'zero')}
    </div>
    ${caption(
      'Singular values over the largest one, for the maxvol handles Φ□, for all points Φ, and for the normal equations ΦᵀΦ.',
      'A perturbation of the capture along a direction is amplified by the inverse of its singular value, so a curve that stays high to the right end means stable cages. The last fifth is where the differences are; each curve’s last value is the inverse of its condition number.',
      'Paper: Figs. 6 and 9.',
    )}
    ${table(
      ['system', 'matrix', 'condition', 'σ first', 'σ at ¼', 'σ at ½', 'σ at ¾', 'σ last', 'last over first'],
      2,
      systems.flatMap((one) =>
        spectraOf(one).map(({ label, color, values, condition: of }) => {
          const at = (part: number) => values[Math.floor((values.length - 1) * part)] ?? null;
          const [first, last] = [at(0), at(1)];
          const ratio = first !== null && last !== null ? last / first : null;
          return [
            one.name,
            colored(color, label),
            condition(of),
            ...[0, 0.25, 0.5, 0.75, 1].map((part) => singular(at(part))),
            singular(ratio),
          ];
        }),
      ),
    )}
  `;
}

function spectraOf({ figures: { spectra } }: SystemReport): readonly Spectrum[] {
  const squares = spectra.full.map((sigma) => (sigma === null ? null : sigma * sigma));
  return [
    {
      label: 'Φ□ (maxvol)',
      color: methodColor({ handles: 'maxvol', regularizer: 'laplacian' }),
      values: spectra.handles,
      condition: spectra.condition_handles,
    },
    {
      label: 'Φ (all points)',
      color: methodColor({ handles: 'all', regularizer: 'none' }),
      values: spectra.full,
      condition: spectra.condition_full,
    },
    {
      label: 'ΦᵀΦ (normal equations)',
      color: OTHER_COLORS.normal,
      values: squares,
      condition: spectra.condition_normal,
    },
  ];
}

function scaled(values: readonly Figure[], from: number): Point[] {
  const top = values[0] ?? 1;
  return values.map((sigma, k): Point => [k + 1, sigma === null ? null : sigma / top]).slice(from);
}
