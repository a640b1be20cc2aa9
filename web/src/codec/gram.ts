/** Columns of Φ whose products are summed together. */
const TILE = 4;

/** Sums up `ΦᵀΦ` of some points at a time. */
export class GramMatrix {
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
      for (let j = 0; j < rows; j++) {
        byColumn[j * count + p] = coordinates[p * columns + j];
      }
    }
    const sums = new Float64Array(TILE * TILE);
    for (let i = 0; i < width; i += TILE) {
      for (let j = 0; j <= i; j += TILE) {
        tile(byColumn, count, i, j, sums);
        for (let k = 0; k < TILE * TILE; k++) {
          const row = i + Math.floor(k / TILE);
          const column = j + (k % TILE);
          if (row < rows && column <= row) {
            lower[row * rows + column] += sums[k];
          }
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
