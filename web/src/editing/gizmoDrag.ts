import { RING, UNITS, type Constraint } from './gizmo';
import { rotationAbout, type Motion, type MotionKind } from './motion';
import { cross, dot, norm, normalized, plus, sub, type Vector } from '../coordinates/vector';
import type { Projection } from '../render/projection';

export interface Point {
  readonly x: number;
  readonly y: number;
}

export interface Drag {
  readonly kind: MotionKind;
  readonly constraint: Constraint;
  /** The pivot, in the scene's unit. */
  readonly at: Vector;
  /** Where it began, and where the pointer is. */
  readonly from: Point;
  readonly to: Point;
  /** Length of the scene's unit, in the capture's. */
  readonly diagonal: number;
}

/** A motion and the number that says how far it goes: an angle in radians, a factor, a length in the capture's unit. */
export interface Dragged {
  readonly motion: Motion;
  readonly amount: number;
}

/** A ring that is seen from its edge more than this is pulled along, not turned around. */
const EDGE_ON = 0.3;
/** Rotations by whole steps, and factors by whole steps, where somebody asks for them. */
const [ANGLE_STEP, FACTOR_STEP] = [Math.PI / 12, 0.1];
/** Scaling never turns inside out. */
const SMALLEST_FACTOR = 0.02;
/** Pixels of a drag of the middle that double the size. */
const DOUBLING = 120;

/**
 * What a drag does.
 *
 * @param before the angle before, which a drag around a ring goes on from beyond half a turn
 * @param isStepped whether it goes by whole steps: 15°, tenths
 */
export function motionOf(projection: Projection, drag: Drag, before = 0, isStepped = false): Dragged {
  const { kind, constraint, at, from, to, diagonal } = drag;
  const stepped = (x: number, step: number) => (isStepped ? step * Math.round(x / step) : x);
  if (kind === 'rotate') {
    const turned = angleBy(projection, at, constraint, from, to);
    const whole = turned + 2 * Math.PI * Math.round((before - turned) / (2 * Math.PI));
    const amount = stepped(whole, ANGLE_STEP);
    const axis = constraint.kind === 'picture' ? projection.axes(at).away : UNITS[constraint.axis];
    return { motion: { kind, rotation: rotationAbout(axis, amount) }, amount };
  }
  if (kind === 'scale') {
    const amount = Math.max(SMALLEST_FACTOR, stepped(factorBy(projection, at, constraint, from, to), FACTOR_STEP));
    const isAlong = (k: number) => constraint.kind !== 'axis' || constraint.axis === k;
    const [x, y, z] = [0, 1, 2].map((k) => (isAlong(k) ? amount : 1));
    return { motion: { kind, factors: [x, y, z] }, amount };
  }
  const [x, y, z] = draggedBy(projection, at, constraint, from, to);
  const by: Vector = [x * diagonal, y * diagonal, z * diagonal];
  return { motion: { kind, by }, amount: norm(by) };
}

/** The angle about an axis, or clockwise about the line of sight, from one place to another; −π to π. */
function angleBy(projection: Projection, at: Vector, constraint: Constraint, from: Point, to: Point): number {
  const middle = projection.place(at);
  if (!middle) return 0;
  if (constraint.kind === 'picture') {
    const [ax, ay, bx, by] = [from.x - middle.x, from.y - middle.y, to.x - middle.x, to.y - middle.y];
    return Math.atan2(ax * by - ay * bx, ax * bx + ay * by);
  }
  const axis = UNITS[constraint.axis];
  const sight = projection.ray(middle.x, middle.y).direction;
  if (Math.abs(dot(axis, sight)) > EDGE_ON) {
    const [a, b] = [from, to].map((place) => whereOnPlane(projection, at, axis, place));
    if (!a || !b) return 0;
    const [start, end] = [sub(a, at), sub(b, at)];
    return Math.atan2(dot(axis, cross(start, end)), dot(start, end));
  }
  // The point of the ring that is next to the eye moves this way in the picture.
  const way = normalized(cross(sight, axis));
  const ahead = projection.place(plus(at, way, RING * projection.unitsPerPixel(at)));
  if (!ahead) return 0;
  const along = (to.x - from.x) * (ahead.x - middle.x) + (to.y - from.y) * (ahead.y - middle.y);
  return along / RING ** 2;
}

/** How many times as large: along an axis by the distance from the pivot, else the farther to the right and upwards the larger. */
function factorBy(projection: Projection, at: Vector, constraint: Constraint, from: Point, to: Point): number {
  if (constraint.kind !== 'axis') return 2 ** ((to.x - from.x + from.y - to.y) / DOUBLING);
  const axis = UNITS[constraint.axis];
  const middle = projection.place(at);
  if (!middle) return 1;
  const begun = dot(draggedBy(projection, at, constraint, middle, from), axis);
  const moved = dot(draggedBy(projection, at, constraint, from, to), axis);
  return Math.abs(begun) > 1e-9 ? (begun + moved) / begun : 1;
}

/** Where a point goes that is dragged from one place in the picture to another; the way, in the scene's unit. */
function draggedBy(projection: Projection, at: Vector, constraint: Constraint, from: Point, to: Point): Vector {
  if (constraint.kind === 'axis') {
    const axis = UNITS[constraint.axis];
    const sight = normalized(sub(at, projection.ray(from.x, from.y).origin));
    // The plane through the axis that faces the eye the most.
    const normal = cross(axis, cross(sight, axis));
    const way = onPlane(projection, at, normal, from, to);
    const along = dot(way, axis);
    return [along * axis[0], along * axis[1], along * axis[2]];
  }
  const normal = constraint.kind === 'plane' ? UNITS[constraint.axis] : projection.axes(at).away;
  return onPlane(projection, at, normal, from, to);
}

/** From where one ray meets a plane to where another one does; nothing where one of them does not. */
function onPlane(projection: Projection, at: Vector, normal: Vector, from: Point, to: Point): Vector {
  const [start, end] = [from, to].map((place) => whereOnPlane(projection, at, normal, place));
  return start && end ? sub(end, start) : [0, 0, 0];
}

/** Where the ray behind a place meets a plane; null where it does not. */
function whereOnPlane(projection: Projection, at: Vector, normal: Vector, { x, y }: Point): Vector | null {
  const { origin, direction } = projection.ray(x, y);
  const slope = dot(direction, normal) / (norm(normal) || 1);
  const distance = dot(sub(at, origin), normal) / (slope * (norm(normal) || 1));
  return Math.abs(slope) > 1e-3 && distance > 0 ? plus(origin, direction, distance) : null;
}
