import type { CoordinateSystem, TriangleMesh } from '../capture';
import { greenRows } from './green';
import { meanValueRows, type RowOf } from './meanValue';

/** Whether Φ of this system can be computed in the page; harmonic coordinates are a numerical solution that the service has. */
export function canCompute(system: CoordinateSystem): boolean {
  return system !== 'harmonic';
}

/** Most bytes that Φ may take, in memory or as texels: more makes browsers and devices fail without a word. */
export const MAX_PHI_BYTES = 2 ** 30;

/** Columns of Φ: the cage's vertices and, for Green coordinates, its faces. */
export function columnsOf(system: CoordinateSystem, cage: TriangleMesh): number {
  const vertices = cage.positions.length / 3;
  return system === 'green' || system === 'green-free' ? vertices + cage.triangles.length / 3 : vertices;
}

/** What fills rows of Φ for points in this cage. Throws for harmonic coordinates, and for cages that are not closed. */
export function rowsOf(system: CoordinateSystem, cage: TriangleMesh): RowOf {
  if (cage.positions.length === 0 || cage.triangles.length === 0)
    throw new Error('The cage is empty; encode the capture again.');
  if (system === 'mvc') return meanValueRows(cage);
  if (system === 'green' || system === 'green-free') return greenRows(cage);
  throw new Error(
    'Harmonic coordinates cannot be computed in the page: open the capture from a service, which sends them.',
  );
}

/**
 * Φ for these points, rows × {@link columnsOf} in double precision, to the definitions of docs/FORMAT.md.
 *
 * `points` holds x y z of each row.
 */
export function computeCoordinates(system: CoordinateSystem, cage: TriangleMesh, points: Float64Array): Float64Array {
  const fill = rowsOf(system, cage);
  const columns = columnsOf(system, cage);
  const rows = points.length / 3;
  const phi = new Float64Array(rows * columns);
  for (let i = 0; i < rows; i++) fill(points[3 * i], points[3 * i + 1], points[3 * i + 2], phi, i * columns);
  return phi;
}
