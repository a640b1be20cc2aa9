import { multiply } from '../codec/dense';
import { eigenvectors } from '../codec/eigen';
import type { GramMatrix } from '../codec/gram';

/** Singular values and right singular vectors of Φ, points × n, whose columns belong to the rows of a cage. */
export interface Spectrum {
  /** Singular values, descending. */
  readonly values: Float64Array;
  /** n × n: the right singular vector of value k is column k. */
  readonly vectors: Float64Array;
  /** Points whose rows of Φ were read: all of them, or some of a large model, whose values are scaled to all. */
  readonly points: number;
}

/**
 * Singular values and vectors from `ΦᵀΦ` of some of so many points: its eigenvectors v, and σ² = vᵀ ΦᵀΦ v. Rounding moves σ by about 1e-16·σ₁²/σ, so values
 * below 1e-8·σ₁ mean nothing.
 *
 * @throws Error with one sentence for a person where Φ is not finite
 */
export function spectrumOf(gram: GramMatrix, points: number): Spectrum {
  const { rows: n, lower } = gram;
  const matrix = lower.slice();
  for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) matrix[j * n + i] = matrix[i * n + j];
  const vectors = eigenvectors(matrix, n);
  if (!vectors) throw new Error('The coordinates of this capture are not finite, so they have no singular values.');
  const images = multiply(matrix, vectors, n, n, n);
  const values = new Float64Array(n);
  for (let at = 0; at < images.length; at++) values[at % n] += vectors[at] * images[at];
  const scale = points / Math.max(1, gram.points);
  for (let k = 0; k < n; k++) values[k] = Math.sqrt(Math.max(0, scale * values[k]));
  return { values, vectors, points: gram.points };
}

/** A right singular vector, the largest of whose entries is positive: n numbers. */
export function vectorOf({ vectors, values }: Spectrum, k: number): Float64Array {
  const n = values.length;
  const vector = Float64Array.from({ length: n }, (_, row) => vectors[row * n + k]);
  let largest = 0;
  for (const entry of vector) if (Math.abs(entry) > Math.abs(largest)) largest = entry;
  return largest < 0 ? vector.map((entry) => -entry) : vector;
}
