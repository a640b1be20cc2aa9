import type { Cage, CoordinateSystem, TriangleMesh } from '../capture';
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

/** Fills a row of Φ from `offset` on: the coordinates of the point at this place among those of the model. */
export type RowOfPoint = (point: number, x: number, y: number, z: number, out: Float64Array, offset: number) => void;

/** What fills rows of Φ for the points of the model in this cage. Throws for harmonic coordinates, and for cages that are not closed. */
export function rowsOf(system: CoordinateSystem, cage: Cage): RowOfPoint {
  const { carriers } = cage;
  if (carriers === undefined) {
    const fill = rowsOfMesh(system, cage);
    return (_, x, y, z, out, offset) => fill(x, y, z, out, offset);
  }
  const columns = columnsOf(system, cage);
  const fills = new Map<number, RowOf>();
  for (const { firstVertex, vertices } of carriers) {
    if (!fills.has(firstVertex)) fills.set(firstVertex, rowsOfMesh(system, componentOf(cage, firstVertex, vertices)));
  }
  let [at, first] = [0, 0];
  return (point, x, y, z, out, offset) => {
    if (point < first) [at, first] = [0, 0];
    for (; point >= first + carriers[at].points; at++) first += carriers[at].points;
    out.fill(0, offset, offset + columns);
    const { firstVertex } = carriers[at];
    fills.get(firstVertex)!(x, y, z, out, offset + firstVertex);
  };
}

/** Some vertices of a mesh with the triangles between them. */
function componentOf({ positions, triangles }: TriangleMesh, firstVertex: number, vertices: number): TriangleMesh {
  const end = firstVertex + vertices;
  const own: number[] = [];
  for (let k = 0; k < triangles.length; k += 3) {
    if (triangles[k] >= firstVertex && triangles[k] < end)
      own.push(triangles[k] - firstVertex, triangles[k + 1] - firstVertex, triangles[k + 2] - firstVertex);
  }
  return { positions: positions.slice(3 * firstVertex, 3 * end), triangles: Uint32Array.from(own) };
}

function rowsOfMesh(system: CoordinateSystem, cage: TriangleMesh): RowOf {
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
 * `points` holds x y z of each row, which are those of the model from `first` on.
 */
export function computeCoordinates(
  system: CoordinateSystem,
  cage: Cage,
  points: Float64Array,
  first = 0,
): Float64Array {
  const fill = rowsOf(system, cage);
  const columns = columnsOf(system, cage);
  const rows = points.length / 3;
  const phi = new Float64Array(rows * columns);
  for (let i = 0; i < rows; i++) fill(first + i, points[3 * i], points[3 * i + 1], points[3 * i + 2], phi, i * columns);
  return phi;
}
