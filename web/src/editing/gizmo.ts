import { cross, dot, length, minus, normalized, plus, type Place, type Projection, type Vector } from './projection';

/** What a drag of the gizmo is bound to: an axis, the plane across one, or the plane of the picture. */
export type Constraint =
  | { readonly kind: 'axis'; readonly axis: 0 | 1 | 2 }
  | { readonly kind: 'plane'; readonly axis: 0 | 1 | 2 }
  | { readonly kind: 'picture' };

const UNITS: readonly Vector[] = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
/** Pixels from the middle to the tip of an arrow, and to the near and far corner of the squares between two arrows. */
const ARROW = 74;
const [SQUARE_NEAR, SQUARE_FAR] = [20, 38];
const [ARROW_REACH, MIDDLE_REACH] = [9, 11];
/** An axis that is seen from its end, and a plane that is seen from its edge, cannot be dragged. */
const SHORTEST = 0.22;

/** An arrow in the picture. */
export interface Arrow {
  readonly axis: 0 | 1 | 2;
  readonly from: Place;
  readonly tip: Place;
  /** 0 where it is seen from its end, to 1. */
  readonly opacity: number;
}

/** A square between two arrows, by its corners. */
export interface Square {
  readonly axis: 0 | 1 | 2;
  readonly corners: readonly Place[];
  readonly opacity: number;
}

/** Arrows along the axes of the capture, squares across them, around a point of the scene: all in the picture. */
export interface Gizmo {
  readonly middle: Place;
  readonly arrows: readonly Arrow[];
  readonly squares: readonly Square[];
}

/** The gizmo around a point; null of one behind the eye. Its size in the picture is always the same. */
export function gizmoAt(projection: Projection, at: Vector): Gizmo | null {
  const middle = projection.place(at);
  const unit = projection.unitsPerPixel(at);
  if (!middle || unit === 0) return null;
  const sight = projection.ray(middle.x, middle.y).direction;
  const placeAt = (...steps: [Vector, number][]) =>
    projection.place(steps.reduce((point, [axis, pixels]) => plus(point, axis, pixels * unit), at)) ?? middle;
  const arrows: Arrow[] = [];
  const squares: Square[] = [];
  for (const axis of [0, 1, 2] as const) {
    const [own, first, second] = [UNITS[axis], UNITS[(axis + 1) % 3], UNITS[(axis + 2) % 3]];
    const facing = Math.abs(dot(own, sight));
    const opacity = (shown: number) => Math.min(1, Math.max(0, (shown - SHORTEST) / 0.15));
    arrows.push({
      axis,
      from: placeAt([own, MIDDLE_REACH + 2]),
      tip: placeAt([own, ARROW]),
      opacity: opacity(Math.sqrt(Math.max(0, 1 - facing * facing))),
    });
    const corners = [
      [SQUARE_NEAR, SQUARE_NEAR],
      [SQUARE_FAR, SQUARE_NEAR],
      [SQUARE_FAR, SQUARE_FAR],
      [SQUARE_NEAR, SQUARE_FAR],
    ].map(([a, b]) => placeAt([first, a], [second, b]));
    squares.push({ axis, corners, opacity: opacity(facing) });
  }
  return { middle, arrows, squares };
}

/** What of the gizmo is at a place in the picture; `slack` pixels more count for fingers. */
export function constraintAt({ middle, arrows, squares }: Gizmo, x: number, y: number, slack = 0): Constraint | null {
  if (Math.hypot(x - middle.x, y - middle.y) <= MIDDLE_REACH + slack) return { kind: 'picture' };
  for (const { axis, corners, opacity } of squares) {
    if (opacity > 0.5 && isWithin(corners, x, y)) return { kind: 'plane', axis };
  }
  let [nearest, least] = [null as Arrow | null, ARROW_REACH + slack];
  for (const arrow of arrows) {
    const distance = arrow.opacity > 0.5 ? fromSegment(arrow, x, y) : Infinity;
    if (distance <= least) [nearest, least] = [arrow, distance];
  }
  return nearest && { kind: 'axis', axis: nearest.axis };
}

/** Where a point goes that is dragged from one place in the picture to another; the way, in the scene's unit. */
export function draggedBy(
  projection: Projection,
  at: Vector,
  constraint: Constraint,
  from: { readonly x: number; readonly y: number },
  to: { readonly x: number; readonly y: number },
): Vector {
  if (constraint.kind === 'axis') {
    const axis = UNITS[constraint.axis];
    const sight = normalized(minus(at, projection.ray(from.x, from.y).origin));
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
function onPlane(
  projection: Projection,
  at: Vector,
  normal: Vector,
  from: { readonly x: number; readonly y: number },
  to: { readonly x: number; readonly y: number },
): Vector {
  const [start, end] = [from, to].map(({ x, y }): Vector | null => {
    const { origin, direction } = projection.ray(x, y);
    const slope = dot(direction, normal) / (length(normal) || 1);
    const distance = dot(minus(at, origin), normal) / (slope * (length(normal) || 1));
    return Math.abs(slope) > 1e-3 && distance > 0 ? plus(origin, direction, distance) : null;
  });
  return start && end ? minus(end, start) : [0, 0, 0];
}

function isWithin(corners: readonly Place[], x: number, y: number): boolean {
  let inside = false;
  corners.forEach((a, k) => {
    const b = corners[(k + 1) % corners.length];
    if (a.y > y !== b.y > y && x < a.x + ((y - a.y) / (b.y - a.y)) * (b.x - a.x)) inside = !inside;
  });
  return inside;
}

function fromSegment({ from, tip }: Arrow, x: number, y: number): number {
  const [dx, dy] = [tip.x - from.x, tip.y - from.y];
  const along = ((x - from.x) * dx + (y - from.y) * dy) / (dx * dx + dy * dy || 1);
  const share = Math.min(1.08, Math.max(0, along));
  return Math.hypot(x - from.x - share * dx, y - from.y - share * dy);
}
