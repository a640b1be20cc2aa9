import { GramMatrix } from '../codec/gram';
import { columnsOf, computeCoordinates } from '../coordinates/compute';
import type { SpectrumRequest } from './messages';

/** Products that are summed up at most, points × rows²: some seconds of work. */
const MAX_PRODUCTS = 4e9;
/** Entries of Φ that are held at a time. */
const BATCH_ENTRIES = 1 << 19;

/**
 * `ΦᵀΦ` of the model, of every so many points of a large one.
 *
 * @param onProgress hears the part that is done, between 0 and 1
 */
export function gramOf(
  { system, cage, rest, rows, phi }: SpectrumRequest,
  onProgress: (fraction: number) => void,
): GramMatrix {
  const gram = new GramMatrix(rows);
  const points = rest.length / 3;
  const columns = columnsOf(system, cage);
  const stride = Math.max(1, Math.ceil((points * rows * rows) / MAX_PRODUCTS));
  const batch = Math.max(1, Math.floor(BATCH_ENTRIES / columns));
  for (let first = 0; first < points; first += batch * stride) {
    const indices: number[] = [];
    for (let point = first; point < points && indices.length < batch; point += stride) indices.push(point);
    const rowsOfPhi = phi ? chosen(phi, columns, indices) : computeCoordinates(system, cage, chosen(rest, 3, indices));
    gram.add(rowsOfPhi, columns);
    onProgress(Math.min(1, (first + batch * stride) / points));
  }
  return gram;
}

/** Some rows of a matrix of so many columns. */
function chosen(matrix: Float32Array | Float64Array, columns: number, rows: readonly number[]): Float64Array {
  const out = new Float64Array(rows.length * columns);
  rows.forEach((row, k) => out.set(matrix.subarray(row * columns, (row + 1) * columns), k * columns));
  return out;
}
