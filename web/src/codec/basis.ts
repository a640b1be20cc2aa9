/** The coordinates in which cages are coded: what a cage's rows do to the model; docs/FORMAT.md, "Basis". `crates/codec/src/basis.rs` is the reference. */

import { cholesky, multiply, solveTransposed, transposedTimesSelf } from './dense';
import { eigenvectors } from './eigen';
import { CodedDataError } from './error';
import { type BasisRecord, roundGram } from './gramRounding';

/** ε over the mean of the diagonal of the Gram matrix. */
const FLOOR = 1e-2;
/** Scaling of the rows that parts equal eigenvalues. */
const SPLIT = 1e-3;
/** Most points whose coordinates make the basis. */
const SAMPLE = 1 << 14;

/** Every how many points one is sampled. */
export function sampleStride(points: number): number {
  return Math.max(1, Math.ceil(points / SAMPLE));
}

/** Sums up `ΦᵀΦ` of the sampled points, some of them at a time, and makes bases of it. */
export class CageBasis {
  private readonly gram: GramMatrix;
  /** The inverse made last, and the record that it is of: all groups of a writer have the same. */
  private latest: { readonly key: string; readonly inverse: Float64Array } | null = null;

  constructor(private readonly rows: number) {
    this.gram = new GramMatrix(rows);
  }

  /** Adds the coordinates of some points, points × columns; columns beyond the stored rows are left out. */
  add(coordinates: Float64Array, columns: number): void {
    this.gram.add(coordinates, columns);
  }

  /**
   * The matrix, rows × rows, that takes coefficients to differences of a cage's rows from those at rest; `record` as the group of cages says.
   *
   * @throws {CodedDataError} where coordinates are not finite.
   */
  inverse(record: BasisRecord): Float64Array {
    if (this.latest?.key !== record.key) {
      const factor = this.factorise(record);
      const inverse = record.rotated ? rotation(factor, this.rows) : identity(this.rows);
      solveTransposed(factor, inverse, this.rows, this.rows);
      this.latest = { key: record.key, inverse };
    }
    return this.latest.inverse;
  }

  /** L of `G = L Lᵀ`. */
  private factorise(record: BasisRecord): Float64Array {
    const { rows } = this;
    const gram = this.gram.lower.map((x) => x / Math.max(this.gram.points, 1));
    if (record.rounding !== null) roundGram(gram, rows, record.rounding);
    let trace = 0;
    for (let k = 0; k < rows; k++) trace += gram[k * rows + k];
    const floor = FLOOR * Math.max(trace / rows, 2.2250738585072014e-308);
    for (let k = 0; k < rows; k++) gram[k * rows + k] += floor;
    const factor = cholesky(gram, rows);
    if (factor === null) throw new CodedDataError('the coordinates have no basis');
    return factor;
  }
}

/** Eigenvectors of `D LᵀL D` as columns, each on the side that the format says. */
function rotation(factor: Float64Array, n: number): Float64Array {
  const inner = transposedTimesSelf(factor, n);
  const part = Float64Array.from({ length: n }, (_, k) => 1 + SPLIT * spread(k));
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < n; j++) inner[i * n + j] *= part[i] * part[j];
  }
  const vectors = eigenvectors(inner, n);
  if (vectors === null) throw new CodedDataError('the coordinates have no basis');
  const sides = multiply(
    Float64Array.from({ length: n }, (_, k) => spread(k) - 0.5),
    vectors,
    1,
    n,
    n,
  );
  for (let at = 0; at < vectors.length; at++) {
    if (sides[at % n] < 0) vectors[at] = -vectors[at];
  }
  return vectors;
}

/** A number between 0 and 1 for each k, spread evenly: fractions of multiples of the golden ratio. */
function spread(k: number): number {
  return (k * 0.6180339887498949) % 1;
}

function identity(n: number): Float64Array {
  const out = new Float64Array(n * n);
  for (let k = 0; k < n; k++) out[k * n + k] = 1;
  return out;
}

/** Columns of Φ whose products are summed together. */
const TILE = 4;

/** Sums up `ΦᵀΦ` of some points at a time. */
class GramMatrix {
  /** The lower half, diagonal included, of the matrix rows × rows. */
  readonly lower: Float64Array;
  points = 0;

  constructor(readonly rows: number) {
    this.lower = new Float64Array(rows * rows);
  }

  /** Adds the coordinates of some points, points × columns; columns beyond the stored rows are left out. */
  add(coordinates: Float64Array, columns: number): void {
    const { rows, lower } = this;
    const count = Math.floor(coordinates.length / columns);
    this.points += count;
    const width = Math.ceil(rows / TILE) * TILE;
    // Column by column, zeros behind the last, so that products are of contiguous numbers and of whole tiles.
    const byColumn = new Float64Array(width * count);
    for (let p = 0; p < count; p++) {
      for (let j = 0; j < rows; j++) byColumn[j * count + p] = coordinates[p * columns + j];
    }
    const sums = new Float64Array(TILE * TILE);
    for (let i = 0; i < width; i += TILE) {
      for (let j = 0; j <= i; j += TILE) {
        tile(byColumn, count, i, j, sums);
        for (let k = 0; k < TILE * TILE; k++) {
          const row = i + Math.floor(k / TILE);
          const column = j + (k % TILE);
          if (row < rows && column <= row) lower[row * rows + column] += sums[k];
        }
      }
    }
  }
}

/** Products of columns i … i + 3 with columns j … j + 3, which are of so many numbers each. */
function tile(byColumn: Float64Array, count: number, i: number, j: number, out: Float64Array): void {
  const i0 = i * count;
  const i1 = i0 + count;
  const i2 = i1 + count;
  const i3 = i2 + count;
  for (let column = 0; column < TILE; column += 2) {
    const ja = (j + column) * count;
    const jb = ja + count;
    let a0 = 0;
    let a1 = 0;
    let a2 = 0;
    let a3 = 0;
    let b0 = 0;
    let b1 = 0;
    let b2 = 0;
    let b3 = 0;
    for (let p = 0; p < count; p++) {
      const ya = byColumn[ja + p];
      const yb = byColumn[jb + p];
      const x0 = byColumn[i0 + p];
      const x1 = byColumn[i1 + p];
      const x2 = byColumn[i2 + p];
      const x3 = byColumn[i3 + p];
      a0 += x0 * ya;
      b0 += x0 * yb;
      a1 += x1 * ya;
      b1 += x1 * yb;
      a2 += x2 * ya;
      b2 += x2 * yb;
      a3 += x3 * ya;
      b3 += x3 * yb;
    }
    out.set([a0, b0], column);
    out.set([a1, b1], TILE + column);
    out.set([a2, b2], 2 * TILE + column);
    out.set([a3, b3], 3 * TILE + column);
  }
}
