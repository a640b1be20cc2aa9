import type { Vector } from '../coordinates/vector';

/** An angle in radians, in degrees. */
export function degrees(angle: number): string {
  return `${Math.round((180 * angle) / Math.PI)}°`.replace('-', '−');
}

/** Factors along x, y and z: one number where they are the same. */
export function timesAs(factors: Vector): string {
  const words = factors.map((factor) => factor.toFixed(2));
  return new Set(words).size === 1 ? `× ${words[0]}` : `× (${words.join(', ')})`;
}
