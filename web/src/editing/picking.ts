import { cross, dot, normalized, sub, type Vector } from '../coordinates/vector';
import type { Place, Projection } from '../render/projection';

export interface PlacedVertex extends Place {
  /** Whether the cage's surface there looks away from the eye. */
  readonly isBehind: boolean;
}

/** Pixels that a vertex at the back counts as farther away, so that one in front of it is taken. */
const BEHIND = 9;

/** Places of all vertices, given their positions in the scene; null of those behind the eye. */
export function placedVertices(
  projection: Projection,
  positions: ArrayLike<number>,
  triangles: Uint32Array,
): (PlacedVertex | null)[] {
  const vertices = Math.floor(positions.length / 3);
  const at = (v: number): Vector => [positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]];
  const normals = new Float64Array(3 * vertices);
  for (let f = 0; f < triangles.length; f += 3) {
    const [a, b, c] = [at(triangles[f]), at(triangles[f + 1]), at(triangles[f + 2])];
    const normal = cross(sub(b, a), sub(c, a));
    for (let corner = f; corner < f + 3; corner++) {
      for (let k = 0; k < 3; k++) normals[3 * triangles[corner] + k] += normal[k];
    }
  }
  return Array.from({ length: vertices }, (_, v) => {
    const place = projection.place(at(v));
    if (!place) return null;
    const { direction } = projection.ray(place.x, place.y);
    const normal = normalized([normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]]);
    return { ...place, isBehind: dot(normal, direction) > 0.15 };
  });
}

/** The vertex nearest to a place in the picture, −1 where none is within `reach` pixels. */
export function vertexAt(places: readonly (PlacedVertex | null)[], x: number, y: number, reach: number): number {
  let [nearest, least] = [-1, Infinity];
  places.forEach((place, v) => {
    if (!place) return;
    const distance = Math.hypot(place.x - x, place.y - y);
    if (distance > reach) return;
    const cost = distance + (place.isBehind ? BEHIND : 0) + place.depth;
    if (cost < least) [nearest, least] = [v, cost];
  });
  return nearest;
}

export interface Rectangle {
  readonly fromX: number;
  readonly fromY: number;
  readonly toX: number;
  readonly toY: number;
}

export function verticesWithin(places: readonly (PlacedVertex | null)[], box: Rectangle): number[] {
  const [left, right] = [Math.min(box.fromX, box.toX), Math.max(box.fromX, box.toX)];
  const [top, bottom] = [Math.min(box.fromY, box.toY), Math.max(box.fromY, box.toY)];
  const found: number[] = [];
  places.forEach((place, v) => {
    if (place && place.x >= left && place.x <= right && place.y >= top && place.y <= bottom) found.push(v);
  });
  return found;
}

/** The nearest vertex roughly in a given direction on the screen, for selection by arrow keys; −1 if no vertex lies that way. */
export function vertexTowards(
  places: readonly (PlacedVertex | null)[],
  from: number,
  direction: { readonly x: number; readonly y: number },
): number {
  const start = places[from];
  if (!start) return -1;
  let [next, least] = [-1, Infinity];
  places.forEach((place, v) => {
    if (!place || v === from || place.isBehind !== start.isBehind) return;
    const [dx, dy] = [place.x - start.x, place.y - start.y];
    const ahead = dx * direction.x + dy * direction.y;
    const aside = Math.abs(dx * direction.y - dy * direction.x);
    if (ahead <= aside) return;
    const cost = ahead + 2 * aside;
    if (cost < least) [next, least] = [v, cost];
  });
  return next;
}
