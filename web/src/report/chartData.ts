import type { AlignedData } from 'uplot';

/** x, and y where there is one. */
export type Point = readonly [number, number | null];

interface Drawn {
  readonly mark: 'line' | 'dashes' | 'dots' | 'diamonds';
  readonly points: readonly Point[];
}

/**
 * Series as uPlot wants them: ascending x, and each series' value for every x. Where series have values at other x than others, lines go on
 * across these; where all have the same, an x without a value is a gap.
 */
export function aligned(
  series: readonly Drawn[],
  isLogX: boolean,
  isLogY: boolean,
): { readonly data: AlignedData; readonly gaps: 'keep' | 'span' } {
  const usable = ([x, y]: Point) => !(isLogX && x <= 0) && !(isLogY && y !== null && y <= 0);
  const lists = series.map(({ points }) => points.filter(usable).toSorted(([a], [b]) => a - b));
  if (series.some(({ mark }) => mark === 'dots' || mark === 'diamonds'))
    return { data: rows(series, lists), gaps: 'span' };
  const all = [...new Set(lists.flatMap((points) => points.map(([x]) => x)))].sort((a, b) => a - b);
  const columns = lists.map((points) => {
    const values = new Map(points);
    return all.map((x) => values.get(x) ?? null);
  });
  const gaps = lists.every((points) => points.length === all.length) ? 'keep' : 'span';
  return { data: [all, ...columns], gaps };
}

/** A row for every point, since several may have the same x. */
function rows(series: readonly Drawn[], lists: readonly (readonly Point[])[]): AlignedData {
  const all = lists
    .flatMap((points, k) => points.map((point) => ({ k, point })))
    .sort((a, b) => a.point[0] - b.point[0]);
  return [
    all.map(({ point }) => point[0]),
    ...series.map((_, k) => all.map((row) => (row.k === k ? row.point[1] : null))),
  ];
}
