/**
 * Eigenvectors of a symmetric matrix: Householder tridiagonalisation, then implicit QR steps with Wilkinson's shift (Golub and Van Loan, Matrix Computations,
 * sections 8.3.1 to 8.3.3).
 */

/** Steps for each eigenvalue before giving up. */
const MAX_STEPS = 50;
/** Rotations that are collected before they are applied to the vectors: those of many steps pass over a row while it is in the cache. */
const ROTATIONS = 1 << 14;
/** Rows of the vectors that are rotated together. */
const ROWS = 4;

/** Eigenvectors of a symmetric matrix n × n as columns, in the order of descending eigenvalues; null where the matrix is not finite. */
export function eigenvectors(matrix: Float64Array, n: number): Float64Array | null {
  if (!matrix.every((x) => Number.isFinite(x))) return null;
  const { diagonal, offDiagonal, vectors } = tridiagonalise(matrix, n);
  if (!diagonalise(diagonal, offDiagonal, vectors, n)) return null;
  const order = Array.from(diagonal.keys()).sort((a, b) => diagonal[b] - diagonal[a]);
  const sorted = new Float64Array(n * n);
  for (let i = 0; i < n; i++) {
    for (let k = 0; k < n; k++) sorted[i * n + k] = vectors[i * n + order[k]];
  }
  return sorted;
}

/** `A = Q T Qᵀ` with T tridiagonal: its diagonal, what is beside it, and Q. */
function tridiagonalise(matrix: Float64Array, n: number) {
  const a = matrix.slice();
  const diagonal = new Float64Array(n);
  const offDiagonal = new Float64Array(n);
  const scales = new Float64Array(n);
  const p = new Float64Array(n);
  for (let i = n - 1; i > 0; i--) {
    const v = a.subarray(i * n, i * n + i);
    diagonal[i] = a[i * n + i];
    offDiagonal[i - 1] = reflector(v, scales, i);
    if (scales[i] === 0) continue;
    // p = scale·A v, then A ← A − v wᵀ − w vᵀ with w = p − ½ scale (pᵀv) v; of A the lower half.
    p.fill(0, 0, i);
    for (let r = 0; r < i; r++) {
      const row = r * n;
      let sum = a[row + r] * v[r];
      for (let c = 0; c < r; c++) {
        sum += a[row + c] * v[c];
        p[c] += a[row + c] * v[r];
      }
      p[r] += sum;
    }
    let inner = 0;
    for (let r = 0; r < i; r++) {
      p[r] *= scales[i];
      inner += p[r] * v[r];
    }
    for (let r = 0; r < i; r++) p[r] -= 0.5 * scales[i] * inner * v[r];
    for (let r = 0; r < i; r++) {
      const row = r * n;
      for (let c = 0; c <= r; c++) a[row + c] -= v[r] * p[c] + p[r] * v[c];
    }
  }
  diagonal[0] = n > 0 ? a[0] : 0;
  return { diagonal, offDiagonal, vectors: reflections(a, scales, n) };
}

/**
 * Makes v the vector of the reflection `I − scale·v vᵀ` that takes all of v but its last entry away; puts the scale at `scales[at]` and returns what the last
 * entry becomes.
 */
function reflector(v: Float64Array, scales: Float64Array, at: number): number {
  const last = v.length - 1;
  let squares = 0;
  for (let k = 0; k < last; k++) squares += v[k] * v[k];
  if (squares === 0) return v[last];
  const length = Math.sqrt(squares + v[last] * v[last]);
  const target = v[last] > 0 ? -length : length;
  // With v divided by its last entry, head, 2 / |v|² is −head / target.
  const head = v[last] - target;
  for (let k = 0; k < last; k++) v[k] /= head;
  v[last] = 1;
  scales[at] = -head / target;
  return target;
}

/** Q of {@link tridiagonalise} from the vectors of its reflections, which are in the rows of `a`; zeros fill it to whole groups of rows. */
function reflections(a: Float64Array, scales: Float64Array, n: number): Float64Array {
  const q = new Float64Array(Math.ceil(n / ROWS) * ROWS * n);
  const sums = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    q[i * n + i] = 1;
    if (scales[i] === 0) continue;
    const v = a.subarray(i * n, i * n + i);
    sums.fill(0, 0, i);
    let r = 0;
    for (; r + 3 < i; r += 4) {
      const v0 = v[r];
      const v1 = v[r + 1];
      const v2 = v[r + 2];
      const v3 = v[r + 3];
      for (let c = 0, at = r * n; c < i; c++, at++) {
        sums[c] += v0 * q[at] + v1 * q[at + n] + v2 * q[at + 2 * n] + v3 * q[at + 3 * n];
      }
    }
    for (; r < i; r++) addScaled(sums, 0, q, r * n, v[r], i);
    for (let row = 0; row < i; row++) addScaled(q, row * n, sums, 0, -scales[i] * v[row], i);
  }
  return q;
}

/** Adds a multiple of one vector to another, both of this length. */
function addScaled(to: Float64Array, at: number, from: Float64Array, start: number, factor: number, length: number) {
  for (let k = 0; k < length; k++) to[at + k] += factor * from[start + k];
}

/** Turns a tridiagonal matrix to a diagonal one, and the columns of `vectors` with it; false if it does not converge. */
function diagonalise(diagonal: Float64Array, offDiagonal: Float64Array, vectors: Float64Array, n: number): boolean {
  const rotations = new Rotations(vectors, n);
  let end = n - 1;
  for (let steps = 0; end > 0; steps++) {
    if (steps > MAX_STEPS * n) return false;
    let start = end;
    while (start > 0 && !isSmall(diagonal, offDiagonal, start - 1)) start--;
    if (start > 0) offDiagonal[start - 1] = 0;
    if (start === end) end--;
    else step(diagonal, offDiagonal, start, end, rotations);
  }
  rotations.apply();
  return true;
}

function isSmall(diagonal: Float64Array, offDiagonal: Float64Array, k: number): boolean {
  return Math.abs(offDiagonal[k]) <= Number.EPSILON * 0.5 * (Math.abs(diagonal[k]) + Math.abs(diagonal[k + 1]));
}

/** One implicit QR step on rows `start` to `end`. */
function step(d: Float64Array, e: Float64Array, start: number, end: number, rotations: Rotations): void {
  const half = (d[end - 1] - d[end]) / 2;
  const beside = e[end - 1];
  const shift = d[end] - (beside * beside) / (half + (half < 0 ? -1 : 1) * Math.hypot(half, beside));
  let x = d[start] - shift;
  let z = e[start];
  for (let k = start; k < end; k++) {
    const length = Math.sqrt(x * x + z * z);
    const c = length > 0 ? x / length : 1;
    const s = length > 0 ? z / length : 0;
    if (k > start) e[k - 1] = length;
    const a = d[k];
    const b = e[k];
    const g = d[k + 1];
    d[k] = c * c * a + 2 * c * s * b + s * s * g;
    d[k + 1] = s * s * a - 2 * c * s * b + c * c * g;
    e[k] = (c * c - s * s) * b + c * s * (g - a);
    x = e[k];
    if (k + 1 < end) {
      z = s * e[k + 1];
      e[k + 1] *= c;
    }
    rotations.add(k, c, s);
  }
}

/** Rotations of neighbouring columns of a matrix that wait to be applied. */
class Rotations {
  private readonly columns = new Uint32Array(ROTATIONS);
  private readonly cosines = new Float64Array(ROTATIONS);
  private readonly sines = new Float64Array(ROTATIONS);
  private count = 0;

  constructor(
    private readonly matrix: Float64Array,
    private readonly n: number,
  ) {}

  add(column: number, cosine: number, sine: number): void {
    if (this.count === ROTATIONS) this.apply();
    this.columns[this.count] = column;
    this.cosines[this.count] = cosine;
    this.sines[this.count] = sine;
    this.count++;
  }

  apply(): void {
    const { matrix, n, columns, cosines, sines, count } = this;
    // Several rows at a time: within one, each rotation waits for the one before.
    for (let first = 0; first < matrix.length; first += ROWS * n) {
      for (let k = 0; k < count; k++) {
        const c = cosines[k];
        const s = sines[k];
        const i0 = first + columns[k];
        const i1 = i0 + n;
        const i2 = i1 + n;
        const i3 = i2 + n;
        const a0 = matrix[i0];
        const b0 = matrix[i0 + 1];
        const a1 = matrix[i1];
        const b1 = matrix[i1 + 1];
        const a2 = matrix[i2];
        const b2 = matrix[i2 + 1];
        const a3 = matrix[i3];
        const b3 = matrix[i3 + 1];
        matrix[i0] = c * a0 + s * b0;
        matrix[i0 + 1] = c * b0 - s * a0;
        matrix[i1] = c * a1 + s * b1;
        matrix[i1 + 1] = c * b1 - s * a1;
        matrix[i2] = c * a2 + s * b2;
        matrix[i2 + 1] = c * b2 - s * a2;
        matrix[i3] = c * a3 + s * b3;
        matrix[i3 + 1] = c * b3 - s * a3;
      }
    }
    this.count = 0;
  }
}
