import { describe, expect, it } from 'vitest';
import { aligned, type Point } from './chartData';

const line = (...points: Point[]) => ({ mark: 'line' as const, points });
const dots = (...points: Point[]) => ({ mark: 'dots' as const, points });

describe('series of a chart', () => {
  it('share their x; where one has no value at an x of another, its line goes on', () => {
    const { data, gaps } = aligned([line([2, 20], [0, 0]), line([1, 5])], false, false);
    expect(data).toEqual([
      [0, 1, 2],
      [0, null, 20],
      [null, 5, null],
    ]);
    expect(gaps).toBe('span');
  });

  it('keep gaps where all have the same x', () => {
    const { data, gaps } = aligned([line([0, 1], [1, null], [2, 3]), line([0, 4], [1, 5], [2, 6])], false, false);
    expect(data[1]).toEqual([1, null, 3]);
    expect(gaps).toBe('keep');
  });

  it('have a row for every dot, also of the same x', () => {
    const { data } = aligned([dots([3, 1], [3, 2]), dots([1, 9])], false, false);
    expect(data).toEqual([
      [1, 3, 3],
      [null, 1, 2],
      [9, null, null],
    ]);
  });

  it('leave out of logarithmic axes what these cannot show', () => {
    const { data } = aligned([line([0, 1], [1, 0], [2, 5], [3, -1])], true, true);
    expect(data).toEqual([[2], [5]]);
  });
});
