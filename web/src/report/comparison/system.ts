import type { Point, Series } from '../../charts/chart';
import type { Comparison, ComparisonGeometry, Figure, MethodFigures, SystemFigures, SystemGeometry } from '../data';
import type { RestPose } from '../geometry/modelInCage';
import { isDashed, methodColor } from '../methods';

/** A coordinate system that could be computed, with all that its sections show. */
export interface SystemReport {
  readonly name: string;
  readonly figures: SystemFigures;
  readonly geometry: SystemGeometry;
}

export interface ComparisonReport {
  readonly figures: Comparison;
  readonly geometry: ComparisonGeometry;
  readonly rest: RestPose;
  readonly systems: readonly SystemReport[];
}

/** The systems of a comparison that could be computed. */
export function systemsOf(figures: Comparison, geometry: ComparisonGeometry): SystemReport[] {
  const computed = figures.systems.filter((system) => system.figures !== null);
  return computed.map(({ name, figures }, k) => ({ name, figures: figures!, geometry: geometry.systems[k] }));
}

/** Rows of a table of all systems. */
export function ofAll<T>(systems: readonly SystemReport[], rows: (figures: SystemFigures) => readonly T[]) {
  return systems.flatMap(({ name: system, figures }) => rows(figures).map((row) => ({ ...row, system })));
}

/** The method that charts over frames show of these. */
export function methodOf({ methods }: SystemFigures, handles: string, regularizer: string) {
  return methods.find((method) => method.handles === handles && method.regularizer === regularizer && method.curve);
}

/** Values of the measured frames in percent, as points of a chart. */
export function overFrames({ capture }: Comparison, values: readonly Figure[]): Point[] {
  return capture.measured.map((frame, k) => [frame, inPercent(values[k])]);
}

/** A line over the measured frames for each method that has one. */
export function curves(
  figures: Comparison,
  methods: readonly MethodFigures[],
  of: keyof MethodFigures['per_frame'],
): Series[] {
  return methods
    .filter(({ curve }) => curve)
    .map((method) => ({
      label: method.name,
      color: methodColor(method),
      mark: isDashed(method) ? 'dashes' : 'line',
      points: overFrames(figures, method.per_frame[of]),
    }));
}

/** Points that have the same label, as one series. */
export function grouped(points: readonly (Omit<Series, 'points'> & { readonly point: Point })[]): Series[] {
  const found = new Map<string, Series>();
  for (const { point, ...look } of points)
    found.set(look.label, { ...look, points: [...(found.get(look.label)?.points ?? []), point] });
  return [...found.values()];
}

export function inPercent(value: Figure): Figure {
  return value === null ? null : 100 * value;
}
