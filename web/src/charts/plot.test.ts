import { describe, expect, it } from 'vitest';
import { axisOf } from './axis';
import { pathOf, thinned } from './plot';

const axis = axisOf([0, 1], 0);

describe('a plot', () => {
  it('breaks lines where there is no value, and shows a value alone', () => {
    const points = [
      [0, 0],
      [0.25, 1],
      [0.5, null],
      [1, 0.5],
    ] as const;
    expect(pathOf(points, axis, axis, 'line')).toBe('M0 1h0L0.25 0M1 0.5h0');
    expect(pathOf(points, axis, axis, 'dots')).toBe('M0 1h0M0.25 0h0M1 0.5h0');
  });

  it('leaves out what a logarithmic axis has no place for', () => {
    const points = [
      [1, 0],
      [10, 1],
    ] as const;
    expect(pathOf(points, axisOf([1, 10], 0, true), axisOf([0.1, 1], 0, true), 'line')).toBe('M1 0h0');
  });

  it('keeps the largest of values that share a place', () => {
    const values = Float32Array.of(1, 3, NaN, 2, 5, NaN);
    expect(thinned(values, (k) => k / 6, 3)).toEqual([
      [0, 3],
      [2 / 6, 2],
      [4 / 6, 5],
    ]);
    expect(thinned(values, (k) => k / 6).map(([, value]) => value)).toEqual([1, 3, null, 2, 5, null]);
  });
});
