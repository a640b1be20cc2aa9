import { html } from 'lit';
import { SIGNED } from '../../render/colorMap';
import { floats } from '../geometry/numbers';
import { methodColor } from '../methods';
import { caption, charts, colorScale, table, viewsOf } from '../table';
import { decimals } from '../text';
import type { View } from '../views';
import { ofAll, type ComparisonReport, type SystemReport } from './system';

/** Vectors on fewer unknowns than this are marked by dots. */
const FEW = 12;

/** Where singular vectors live on the cage. */
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
