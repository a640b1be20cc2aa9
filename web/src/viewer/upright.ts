import type { StaticPart, UpAxis } from '../capture';
import { boundsOf } from '../coordinates/topology';

/** What is no farther from 0 than this part of its size has its ground there. */
const NEAR = 0.05;
/** Depth of somebody who stands, as a part of the height, and the most that outstretched arms reach. */
const [SHALLOWEST, DEEPEST, WIDEST] = [0.08, 0.33, 1.3];

/**
 * The axis of a capture that points up: the one that its file says, else a guess. What begins at 0 along one of y and z alone stands on the ground there. Of the rest, what stands along z as people
 * do, deep along y and at least as wide along x, has z; all else has y, as most programs of animation.
 */
export function usualUp({ up, rest, origin }: Pick<StaticPart, 'up' | 'rest' | 'origin'>): UpAxis {
  if (up) return up;
  const { low, high } = boundsOf(rest);
  const [x, y, z] = high.map((end, axis) => end - low[axis]);
  const begins = (axis: number, size: number) => Math.abs(low[axis] + (origin?.[axis] ?? 0)) <= NEAR * size;
  const [alongY, alongZ] = [begins(1, y), begins(2, z)];
  if (alongY !== alongZ) return alongZ ? 'z' : 'y';
  const stands = z > 0 && y >= SHALLOWEST * z && y <= DEEPEST * z && x >= y && x <= WIDEST * z;
  return stands ? 'z' : 'y';
}
