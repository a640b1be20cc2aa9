import { describe, expect, it } from 'vitest';
import { CageBasis, sampleStride } from './basis';
import { cholesky, multiply, solveTransposed, transposedTimesSelf } from './dense';
import { eigenvectors } from './eigen';

/** Numbers between −½ and ½. */
function numbers(length: number, seed = 1): Float64Array {
  let state = seed;
  return Float64Array.from({ length }, () => (state = (state * 48_271) % 2_147_483_647) / 2_147_483_647 - 0.5);
}

function transposed(a: Float64Array, n: number, m: number): Float64Array {
  return Float64Array.from({ length: n * m }, (_, at) => a[(at % n) * m + Math.floor(at / n)]);
}

function identity(n: number): Float64Array {
  return Float64Array.from({ length: n * n }, (_, at) => (at % (n + 1) === 0 ? 1 : 0));
}

function farthest(a: Float64Array, b: Float64Array): number {
  expect(a.length).toBe(b.length);
  return a.reduce((far, x, k) => Math.max(far, Math.abs(x - b[k])), 0);
}

/** `AᵀA` of numbers n × n, positive definite. */
function positive(n: number): Float64Array {
  const a = numbers(n * n, 5);
  return multiply(transposed(a, n, n), a, n, n, n).map((x, at) => x + (at % (n + 1) === 0 ? 0.1 : 0));
}

it('products are sums of products', () => {
  const [a, b] = [numbers(5 * 7), numbers(7 * 3, 2)];
  const out = multiply(a, b, 5, 7, 3);
  let sum = 0;
  for (let k = 0; k < 7; k++) sum += a[4 * 7 + k] * b[k * 3 + 1];
  expect(out[4 * 3 + 1]).toBeCloseTo(sum, 14);
});

describe.each([1, 2, 6, 41])('of %i rows', (n) => {
  it('a Cholesky factor gives back its matrix, and solves by its transpose', () => {
    const matrix = positive(n);
    const lower = cholesky(matrix, n)!;
    expect(farthest(multiply(lower, transposed(lower, n, n), n, n, n), matrix)).toBeLessThan(1e-13);
    const upper = transposed(lower, n, n);
    expect(farthest(transposedTimesSelf(lower, n), multiply(upper, lower, n, n, n))).toBeLessThan(1e-13);
    const inverse = identity(n);
    solveTransposed(lower, inverse, n, n);
    expect(farthest(multiply(upper, inverse, n, n, n), identity(n))).toBeLessThan(1e-12);
  });

  it('eigenvectors are orthonormal, diagonalise their matrix and are in order', () => {
    const matrix = positive(n);
    const vectors = eigenvectors(matrix, n)!;
    const left = transposed(vectors, n, n);
    expect(farthest(multiply(left, vectors, n, n, n), identity(n))).toBeLessThan(1e-13);
    const diagonal = multiply(left, multiply(matrix, vectors, n, n, n), n, n, n);
    const values = Float64Array.from({ length: n }, (_, k) => diagonal[k * n + k]);
    expect(
      farthest(
        diagonal,
        identity(n).map((x, at) => (x === 1 ? values[at % n] : 0)),
      ),
    ).toBeLessThan(1e-12);
    expect(values).toEqual(values.slice().sort((a, b) => b - a));
  });
});

it('a matrix that is not positive definite has no factor, one that is not finite no eigenvectors', () => {
  expect(cholesky(Float64Array.of(1, 2, 2, 1), 2)).toBeNull();
  expect(cholesky(Float64Array.of(Number.NaN), 1)).toBeNull();
  expect(eigenvectors(Float64Array.of(1, Number.NaN, Number.NaN, 1), 2)).toBeNull();
});

it('eigenvectors of repeated and of zero eigenvalues are orthonormal', () => {
  const matrix = identity(9).map((x, at) => (at % 9 < 4 ? x : 0));
  const vectors = eigenvectors(matrix, 9)!;
  expect(farthest(multiply(transposed(vectors, 9, 9), vectors, 9, 9, 9), identity(9))).toBeLessThan(1e-14);
});

describe('CageBasis', () => {
  const [points, rows, columns] = [50, 7, 9];
  const phi = numbers(points * columns, 3);
  const basisOf = (batch: number) => {
    const basis = new CageBasis(rows);
    for (let start = 0; start < points; start += batch) {
      basis.add(phi.slice(start * columns, Math.min(points, start + batch) * columns), columns);
    }
    return basis;
  };

  it('does not depend on how many points are added at a time', () => {
    const record = { rotated: true, rounding: null, key: '1' };
    expect(farthest(basisOf(50).inverse(record), basisOf(11).inverse(record))).toBeLessThan(1e-12);
  });

  it('has coefficients whose lengths are what they move the model', () => {
    const stored = Float64Array.from(
      { length: points * rows },
      (_, at) => phi[Math.floor(at / rows) * columns + (at % rows)],
    );
    const gram = multiply(transposed(stored, points, rows), stored, rows, points, rows).map((x) => x / points);
    const trace = gram.reduce((sum, x, at) => sum + (at % (rows + 1) === 0 ? x : 0), 0);
    const floored = gram.map((x, at) => x + (at % (rows + 1) === 0 ? (0.01 * trace) / rows : 0));
    for (const rotated of [false, true]) {
      const inverse = basisOf(50).inverse({ rotated, rounding: null, key: String(rotated) });
      const product = multiply(
        transposed(inverse, rows, rows),
        multiply(floored, inverse, rows, rows, rows),
        rows,
        rows,
        rows,
      );
      expect(farthest(product, identity(rows))).toBeLessThan(1e-12);
    }
  });
});

it('at most 16,384 points are sampled', () => {
  expect([1, 16_384, 16_385, 40_000].map(sampleStride)).toEqual([1, 1, 2, 3]);
});
