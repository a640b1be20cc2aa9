import { html } from 'lit';
import type { Cover, Series } from '../../charts/chart';
import type { Figure, SystemFigures } from '../data';
import { methodColor, OTHER_COLORS } from '../methods';
import { caption, charts, colored, table, colorScale, viewsOf } from '../table';
import { condition, singular, decimals } from '../text';
import { ofAll, type ComparisonReport, type SystemReport } from './system';
import { SIGNED } from '../../render/colorMap';
import { floats } from '../geometry/numbers';
import type { View } from '../views';

const MAXVOL_COLOR = methodColor({ handles: 'maxvol', regularizer: 'laplacian' });
const FULL_COLOR = methodColor({ handles: 'all', regularizer: 'none' });

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

/** Vectors on fewer unknowns than this are marked by dots. */
const FEW = 12;

export function vectors({ systems, rest }: ComparisonReport, system: SystemReport) {
  const { spread } = system.figures.vectors;
  return html`
    ${viewsOf('Singular vectors on the cage', { views: vectorViews(rest, system), framed: rest.cageVertices })}
    ${colorScale('largest negative', 'largest positive', SIGNED.gradient)}
    ${caption(
      'A few of the first and the last right singular vectors of Φ□, painted on the rest cage.',
      'Each has its own scale about zero, on which small values are raised so that they are seen. The first move the whole cage, and the points say clearly how far; the last are concentrated on a few vertices, marked by dots, that hardly influence any point, so smoothing them costs little accuracy. (Of systems with unknowns on faces, the vertices’ part is shown.)',
      'Paper: Figs. 11 and 15.',
    )}
    ${charts({
      title: 'How widely vectors are spread',
      x: { label: 'singular vector number' },
      y: { label: 'unknowns it lives on', cover: 'zero' },
      series: [
        {
          label: '',
          color: methodColor({ handles: 'maxvol', regularizer: 'laplacian' }),
          mark: 'line',
          points: spread.map((value, k) => [k + 1, value]),
        },
      ],
    })}
    ${caption(
      'The number of unknowns on which each right singular vector of Φ□ lives.',
      'Measured by 1 / Σ v⁴: all unknowns for a vector spread evenly, one for a vector on a single unknown. Where the curve is low at the right end, regularising the last directions acts locally.',
      'Paper: Figs. 11 and 15, as a measure.',
    )}
    ${table(
      ofAll(systems, (figures) => figures.vectors.painted.map((k) => ({ k, figures }))),
      [
        ['system', (row) => row.system],
        ['vector', ({ k, figures }) => `${k + 1} of ${figures.unknowns}`],
        ['singular value', ({ k, figures }) => decimals(figures.spectra.handles[k], 4)],
        ['lives on so many unknowns', ({ k, figures }) => decimals(figures.vectors.spread[k], 1)],
      ],
    )}
  `;
}

function vectorViews(rest: ComparisonReport['rest'], { figures, geometry }: SystemReport): View[] {
  return figures.vectors.painted.map((k, at) => {
    const values = floats(geometry.vectors[at]);
    const top = values.reduce((most, value) => Math.max(most, Math.abs(value)), 0) || 1;
    // Small ones are raised.
    const places = values.map((value) => 0.5 + 0.5 * Math.sign(value) * Math.sqrt(Math.abs(value) / top));
    const spread = figures.vectors.spread[k];
    const vertices = rest.cageVertices;
    const isMarked = (i: number) => Math.abs(values[Math.floor(i / 3)]) > 0.25 * top;
    const marks =
      spread !== null && spread < FEW
        ? { marks: { positions: vertices.filter((_, i) => isMarked(i)), through: true } }
        : {};
    const sigma = figures.spectra.handles.at(k) ?? null;
    const drawing = {
      surface: { positions: vertices, triangles: rest.cage.triangles, values: places, signed: true, flat: true },
      cage: { mesh: rest.cage, vertices },
      ...marks,
    };
    return {
      title: `vector ${k + 1} of ${figures.unknowns}`,
      note:
        sigma === null
          ? 'no singular value: beyond the rank'
          : `singular value ${sigma.toFixed(3)}, on ${decimals(spread, 0)} unknowns`,
      drawing: () => drawing,
    };
  });
}
