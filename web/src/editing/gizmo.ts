import type { MotionKind } from './motion';
import { cross, dot, normalized, plus, type Vector } from '../coordinates/vector';
import type { Place, Projection } from '../render/projection';

/** What a drag of the gizmo is bound to: an axis, the plane across one, or the plane of the picture; rotations are about the axis, or about the line of sight. */
export type Constraint =
  | { readonly kind: 'axis'; readonly axis: 0 | 1 | 2 }
  | { readonly kind: 'plane'; readonly axis: 0 | 1 | 2 }
  | { readonly kind: 'picture' };

export const UNITS: readonly Vector[] = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
/** Pixels from the middle to the tip of an arrow, and to the near and far corner of the squares between two arrows. */
const ARROW = 74;
const [SQUARE_NEAR, SQUARE_FAR] = [20, 38];
const [ARROW_REACH, MIDDLE_REACH] = [9, 11];
/** Pixels from the middle to the rings about the axes, and to the one about the line of sight. */
export const [RING, OUTER_RING] = [62, 82];
const RING_POINTS = 64;
/** An axis that is seen from its end, and a plane that is seen from its edge, cannot be dragged. */
const SHORTEST = 0.22;

export interface Arrow {
  readonly axis: 0 | 1 | 2;
  readonly from: Place;
  readonly tip: Place;
  /** 0 where it is seen from its end, to 1. */
  readonly opacity: number;
}

export interface Square {
  readonly axis: 0 | 1 | 2;
  readonly corners: readonly Place[];
  readonly opacity: number;
}

/** A ring to rotate by: about an axis, or about the line of sight. */
export interface Ring {
  readonly axis: 0 | 1 | 2 | null;
  readonly points: readonly (Place & { readonly isBehind: boolean })[];
}

/** Handles around a point of the scene, in the picture: arrows along the capture's axes, squares across them to move by, rings to rotate by. */
export interface Gizmo {
  readonly kind: MotionKind;
  readonly middle: Place;
  readonly arrows: readonly Arrow[];
  readonly squares: readonly Square[];
  readonly rings: readonly Ring[];
}

/** The gizmo around a point; null of one behind the eye. Its size in the picture is always the same. */
export function gizmoAt(projection: Projection, at: Vector, kind: MotionKind = 'move'): Gizmo | null {
  const middle = projection.place(at);
  const unit = projection.unitsPerPixel(at);
  if (!middle || unit === 0) return null;
  const sight = projection.ray(middle.x, middle.y).direction;
  const placeAt = (...steps: [Vector, number][]) =>
    projection.place(steps.reduce((point, [axis, pixels]) => plus(point, axis, pixels * unit), at)) ?? middle;
  if (kind === 'rotate') {
    const rings = [0, 1, 2, null].map((axis) => ringAt(axis as Ring['axis'], sight, placeAt));
    return { kind, middle, arrows: [], squares: [], rings };
  }
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
  return { kind, middle, arrows, squares: kind === 'move' ? squares : [], rings: [] };
}

function ringAt(axis: Ring['axis'], sight: Vector, placeAt: (...steps: [Vector, number][]) => Place): Ring {
  const about = axis === null ? sight : UNITS[axis];
  const first = normalized(cross(about, Math.abs(about[0]) < 0.7 ? UNITS[0] : UNITS[1]));
  const second = cross(about, first);
  const radius = axis === null ? OUTER_RING : RING;
  const points = Array.from({ length: RING_POINTS }, (_, k) => {
    const angle = (2 * Math.PI * k) / RING_POINTS;
    const [a, b] = [radius * Math.cos(angle), radius * Math.sin(angle)];
    // What is exactly as far away as the middle counts as in front: rings that are seen whole have no back.
    const isBehind = a * dot(first, sight) + b * dot(second, sight) > 0.12 * radius;
    return { ...placeAt([first, a], [second, b]), isBehind };
  });
  return { axis, points };
}

/** What of the gizmo is at a place in the picture; `slack` pixels more count for fingers. */
export function constraintAt(gizmo: Gizmo, x: number, y: number, slack = 0): Constraint | null {
  const { middle, arrows, squares } = gizmo;
  if (gizmo.kind === 'rotate') return ringNear(gizmo.rings, x, y, ARROW_REACH + slack);
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

function ringNear(rings: readonly Ring[], x: number, y: number, reach: number): Constraint | null {
  let [nearest, least] = [null as Ring | null, reach];
  for (const ring of rings) {
    ring.points.forEach((from, k) => {
      const tip = ring.points[(k + 1) % ring.points.length];
      const distance = from.isBehind || tip.isBehind ? Infinity : fromSegment({ from, tip }, x, y, 1);
      if (distance <= least) [nearest, least] = [ring, distance];
    });
  }
  if (!nearest) return null;
  return nearest.axis === null ? { kind: 'picture' } : { kind: 'axis', axis: nearest.axis };
}

function isWithin(corners: readonly Place[], x: number, y: number): boolean {
  let inside = false;
  corners.forEach((a, k) => {
    const b = corners[(k + 1) % corners.length];
    if (a.y > y !== b.y > y && x < a.x + ((y - a.y) / (b.y - a.y)) * (b.x - a.x)) inside = !inside;
  });
  return inside;
}

/** Distance from a line of the picture, which counts as `longer` times as long. */
function fromSegment({ from, tip }: Pick<Arrow, 'from' | 'tip'>, x: number, y: number, longer = 1.08): number {
  const [dx, dy] = [tip.x - from.x, tip.y - from.y];
  const along = ((x - from.x) * dx + (y - from.y) * dy) / (dx * dx + dy * dy || 1);
  const share = Math.min(longer, Math.max(0, along));
  return Math.hypot(x - from.x - share * dx, y - from.y - share * dy);
}
