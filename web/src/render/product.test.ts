import { expect, it } from 'vitest';
import { multiply } from './product';

it.each([1, 2, 5])('multiplies Φ of %i points by the columns', (points) => {
  const phi = Float32Array.from({ length: 3 * points }, (_, k) => k + 1);
  const values = [Float64Array.of(1, 0, 2), Float64Array.of(0, 1, 0), Float64Array.of(-1, 1, 0.5)] as const;
  const out = new Float32Array(4 * points);
  multiply(phi, values, out);
  for (let p = 0; p < points; p++) {
    const [a, b, c] = phi.subarray(3 * p, 3 * p + 3);
    expect([...out.subarray(4 * p, 4 * p + 3)]).toEqual([a + 2 * c, b, b - a + c / 2]);
  }
});
