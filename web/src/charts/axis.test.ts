import { describe, expect, it } from 'vitest';
import { axisOf } from './axis';

describe('an axis', () => {
  it('has lines at round numbers', () => {
    expect(axisOf([0, 1.06], 5).ticks).toEqual([0, 0.5, 1]);
    expect(axisOf([0, 498], 6).ticks).toEqual([0, 100, 200, 300, 400]);
    expect(axisOf([1e-3, 2e4], 5, true).ticks).toEqual([1e-3, 1e-2, 0.1, 1, 10, 100, 1e3, 1e4]);
    expect(axisOf([0.03, 1.2], 5, true).ticks).toEqual([0.05, 0.1, 0.2, 0.5, 1]);
    expect(axisOf([120, 380], 4, true).ticks).toEqual([200, 300]);
  });

  it('finds the value at a place again', () => {
    for (const isLog of [false, true]) {
      const axis = axisOf([0.5, 80], 5, isLog);
      expect(axis.place(80)).toBe(1);
      expect(axis.valueAt(axis.place(7))).toBeCloseTo(7, 9);
    }
    expect(Number.isFinite(axisOf([3, 3], 5).place(3))).toBe(true);
  });
});
