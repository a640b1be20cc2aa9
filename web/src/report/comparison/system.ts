import type { Comparison, ComparisonGeometry, Figure, SystemFigures, SystemGeometry } from '../data';
import type { RestPose } from '../geometry/modelInCage';
import type { Point } from '../chart';

/** A coordinate system that could be computed, with all that its sections show. */
export interface SystemReport {
  readonly name: string;
  readonly figures: SystemFigures;
  readonly geometry: SystemGeometry;
}

/** All that the sections of a comparison read. */
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

/** Values of the measured frames in percent, as points of a chart. */
export function overFrames({ capture }: Comparison, values: readonly Figure[]): Point[] {
  return capture.measured.map((frame, k) => [frame, inPercent(values[k])]);
}

export function inPercent(value: Figure): Figure {
  return value === null ? null : 100 * value;
}
