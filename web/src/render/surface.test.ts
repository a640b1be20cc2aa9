import { describe, expect, it } from 'vitest';
import { surfaceOf } from './surface';

/** A square and a triangle that share an edge, and a point of no face. */
const model = {
  rest: new Float64Array(18),
  cornerCounts: Uint32Array.of(4, 3),
  corners: Uint32Array.of(0, 1, 2, 3, 1, 4, 2),
};

describe('surfaceOf', () => {
  it('cuts polygons into fans and keeps their own edges', () => {
    const { triangles, edges } = surfaceOf(model);
    expect([...triangles]).toEqual([0, 1, 2, 0, 2, 3, 1, 4, 2]);
    expect([...edges]).toEqual([0, 1, 0, 3, 1, 2, 1, 4, 2, 3, 2, 4]);
  });

  it('lists the triangles around each point in their orientation', () => {
    const { fanStarts, fans } = surfaceOf(model);
    const around = (p: number) => [...fans.slice(2 * fanStarts[p], 2 * fanStarts[p + 1])];
    expect(around(0)).toEqual([1, 2, 2, 3]);
    expect(around(1)).toEqual([2, 0, 4, 2]);
    expect(around(5)).toEqual([]);
  });

  it('refuses corners that are no points', () => {
    expect(() => surfaceOf({ ...model, corners: Uint32Array.of(0, 1, 2, 3, 1, 9, 2) })).toThrow(/point 9/);
  });
});
