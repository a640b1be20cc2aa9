import { Quaternion as Turn, Vector3 } from 'three';
import { norm, plus, sub, type Vector } from '../coordinates/vector';

/** A rotation as a unit quaternion x y z w. Its sign counts: a negative w is a rotation by more than half a turn. */
export type Quaternion = readonly [number, number, number, number];

/** What is done to vertices: moved in the capture's unit, or rotated or scaled about their pivot, along the axes of the capture. */
export type Motion =
  | { readonly kind: 'move'; readonly by: Vector }
  | { readonly kind: 'rotate'; readonly rotation: Quaternion }
  | { readonly kind: 'scale'; readonly factors: Vector };

export type MotionKind = Motion['kind'];

/** A rotation about an axis, in radians, counter-clockwise where the axis points at the eye. */
export function rotationAbout(axis: Vector, angle: number): Quaternion {
  return new Turn().setFromAxisAngle(new Vector3(...axis).normalize(), angle).toArray();
}

/** Angle of a rotation, from 0 to 2π. */
export function angleOf([x, y, z, w]: Quaternion): number {
  return 2 * Math.atan2(Math.hypot(x, y, z), w);
}

/** One motion after another of the same kind. */
export function combined(first: Motion, second: Motion): Motion {
  if (first.kind === 'move' && second.kind === 'move') return { kind: 'move', by: plus(first.by, second.by) };
  if (first.kind === 'rotate' && second.kind === 'rotate')
    return { kind: 'rotate', rotation: new Turn(...second.rotation).multiply(new Turn(...first.rotation)).toArray() };
  if (first.kind === 'scale' && second.kind === 'scale') {
    const [a, b] = [first.factors, second.factors];
    return { kind: 'scale', factors: [a[0] * b[0], a[1] * b[1], a[2] * b[2]] };
  }
  throw new TypeError('Motions of different kinds are different edits.');
}

export function isIdentity(motion: Motion): boolean {
  if (motion.kind === 'move') return motion.by.every((x) => x === 0);
  if (motion.kind === 'scale') return motion.factors.every((factor) => factor === 1);
  return motion.rotation.slice(0, 3).every((x) => x === 0);
}

/** The motion on the other side of the plane across an axis. */
export function mirrored(motion: Motion, axis: 0 | 1 | 2): Motion {
  const flipped = (v: Vector, isFlipped: (k: number) => boolean) => v.map((x, k) => (isFlipped(k) ? -x : x));
  if (motion.kind === 'move') return { kind: 'move', by: flipped(motion.by, (k) => k === axis) as unknown as Vector };
  if (motion.kind === 'scale') return motion;
  const [x, y, z, w] = motion.rotation;
  // A mirror turns rotations about its own axis to themselves, and all others the other way.
  return {
    kind: 'rotate',
    rotation: [...flipped([x, y, z], (k) => k !== axis), w] as unknown as Quaternion,
  };
}

/** Where a part of a motion, 0 to 1, takes a point that lies at `arm` from the pivot: the way there. */
export function displacement(motion: Motion, part: number, arm: Vector): Vector {
  if (motion.kind === 'move') return [part * motion.by[0], part * motion.by[1], part * motion.by[2]];
  if (motion.kind === 'scale') {
    const along = (k: 0 | 1 | 2) => arm[k] * (motion.factors[k] ** part - 1);
    return [along(0), along(1), along(2)];
  }
  const [x, y, z] = motion.rotation;
  if (norm([x, y, z]) === 0) return [0, 0, 0];
  const turn = new Turn(...rotationAbout([x, y, z], part * angleOf(motion.rotation)));
  return sub(new Vector3(...arm).applyQuaternion(turn).toArray(), arm);
}

/** An angle in radians, in degrees. */
export function degrees(angle: number): string {
  return `${Math.round((180 * angle) / Math.PI)}°`.replace('-', '−');
}

/** Factors along x, y and z: one number where they are the same. */
export function timesAs(factors: Vector): string {
  const words = factors.map((factor) => factor.toFixed(2));
  return new Set(words).size === 1 ? `× ${words[0]}` : `× (${words.join(', ')})`;
}
