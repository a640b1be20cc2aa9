/** Products and factors of dense matrices in double precision, stored row by row. */

/** `A·B`, n × p, of A n × m and B m × p. */
export function multiply(a: Float64Array, b: Float64Array, n: number, m: number, p: number): Float64Array {
  const out = new Float64Array(n * p);
  for (let i = 0; i < n; i++) addRows(out.subarray(i * p, (i + 1) * p), b, p, 0, m, a, i * m, 1);
  return out;
}

/** Lower Cholesky factor of a symmetric positive definite matrix n × n, zeros above; null if it is not positive definite. */
export function cholesky(matrix: Float64Array, n: number): Float64Array | null {
  const factor = new Float64Array(n * n);
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) {
      const value = matrix[i * n + j] - dot(factor, i * n, j * n, j);
      if (j < i) {
        factor[i * n + j] = value / factor[j * n + j];
      } else if (value > 0 && value < Infinity) {
        factor[i * n + i] = Math.sqrt(value);
      } else {
        return null;
      }
    }
  }
  return factor;
}

/** `LᵀL` of a lower triangular matrix n × n. */
export function transposedTimesSelf(lower: Float64Array, n: number): Float64Array {
  const out = new Float64Array(n * n);
  for (let i = 0; i < n; i++) {
    const row = out.subarray(i * n, i * n + i + 1);
    addRows(row, lower, n, i, n, lower, i, n);
    for (let j = 0; j < i; j++) out[j * n + i] = row[j];
  }
  return out;
}

/** Solves `Lᵀ X = B` in place for a lower triangular matrix L n × n and X = B n × p. */
export function solveTransposed(lower: Float64Array, x: Float64Array, n: number, p: number): void {
  const sum = new Float64Array(p);
  for (let k = n - 1; k >= 0; k--) {
    sum.fill(0);
    addRows(sum, x, p, k + 1, n, lower, k, n);
    const scale = 1 / lower[k * n + k];
    for (let j = 0, at = k * p; j < p; j++, at++) x[at] = (x[at] - sum[j]) * scale;
  }
}

/**
 * Adds multiples of the rows `from` to `to − 1` of a matrix with rows of `stride` numbers to a vector, which may be shorter than a row. The factor of row k is
 * `factors[start + k·step]`.
 */
function addRows(
  sum: Float64Array,
  matrix: Float64Array,
  stride: number,
  from: number,
  to: number,
  factors: Float64Array,
  start: number,
  step: number,
): void {
  let k = from;
  // Four rows at a time, so that the sum is read and written less often.
  for (; k + 3 < to; k += 4) {
    const f0 = factors[start + k * step];
    const f1 = factors[start + (k + 1) * step];
    const f2 = factors[start + (k + 2) * step];
    const f3 = factors[start + (k + 3) * step];
    for (let j = 0, at = k * stride; j < sum.length; j++, at++) {
      sum[j] +=
        f0 * matrix[at] + f1 * matrix[at + stride] + f2 * matrix[at + 2 * stride] + f3 * matrix[at + 3 * stride];
    }
  }
  for (; k < to; k++) {
    const factor = factors[start + k * step];
    for (let j = 0, at = k * stride; j < sum.length; j++, at++) sum[j] += factor * matrix[at];
  }
}

/** Product of two vectors of this length that begin at these places. */
function dot(values: Float64Array, a: number, b: number, length: number): number {
  let s0 = 0;
  let s1 = 0;
  let s2 = 0;
  let s3 = 0;
  let k = 0;
  for (; k + 3 < length; k += 4) {
    s0 += values[a + k] * values[b + k];
    s1 += values[a + k + 1] * values[b + k + 1];
    s2 += values[a + k + 2] * values[b + k + 2];
    s3 += values[a + k + 3] * values[b + k + 3];
  }
  for (; k < length; k++) s0 += values[a + k] * values[b + k];
  return s0 + s1 + s2 + s3;
}
