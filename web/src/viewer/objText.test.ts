import { expect, test } from 'vitest';
import { objOf } from './objText';

test('a frame as Wavefront text has its points in single precision, its polygons, and its place', () => {
  const part = { cornerCounts: Uint32Array.of(3, 4), corners: Uint32Array.of(0, 1, 2, 0, 1, 2, 3) };
  const positions = Float32Array.of(0, 0.1, 0, 1, 0, 0, 1, 1, 0, 0, 1, 1e-7);
  const lines = objOf(part, positions).split('\n');
  expect(lines.slice(0, 2)).toEqual(['v 0 0.100000001 0', 'v 1 0 0']);
  expect(lines.slice(4)).toEqual(['f 1 2 3', 'f 1 2 3 4', '']);
  const far = objOf({ ...part, origin: Float64Array.of(450_000, 0, -2) }, positions).split('\n');
  expect(far[1]).toBe('v 450001 0 -2');
});
