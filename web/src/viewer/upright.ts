import type { StaticPart, UpAxis } from '../capture';
import { boundsOf } from '../coordinates/topology';

/** Depth of somebody who stands, as a part of the height, and the most that outstretched arms reach. */
const [SHALLOWEST, DEEPEST, WIDEST] = [0.08, 0.33, 1.3];

/**
 * The axis of a capture that points up: the one that its file says, else a guess. What stands along z as people do, deep along y and at least as wide along x, has z; all
 * else has y, as most programs of animation.
 */
export function usualUp({ up, rest }: Pick<StaticPart, 'up' | 'rest'>): UpAxis {
  if (up) return up;
  const { low, high } = boundsOf(rest);
  const [x, y, z] = high.map((end, axis) => end - low[axis]);
  const stands = z > 0 && y >= SHALLOWEST * z && y <= DEEPEST * z && x >= y && x <= WIDEST * z;
  return stands ? 'z' : 'y';
}
