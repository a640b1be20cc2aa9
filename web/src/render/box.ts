import { Vector3, type Matrix4 } from 'three';
import type { Box } from './camera';

/** The box around points, x y z each, after a turn. */
export function boxOf(positions: Float32Array, turn: Matrix4): Box {
  const low: [number, number, number] = [Infinity, Infinity, Infinity];
  const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  const point = new Vector3();
  for (let k = 0; k < positions.length; k += 3) {
    point.set(positions[k], positions[k + 1], positions[k + 2]).applyMatrix4(turn);
    for (let axis = 0; axis < 3; axis++) {
      const value = point.getComponent(axis);
      low[axis] = Math.min(low[axis], value);
      high[axis] = Math.max(high[axis], value);
    }
  }
  return { low, high };
}
