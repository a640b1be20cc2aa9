import type { CageGraph } from './falloff';

export type Axis = 'x' | 'y' | 'z';
export const AXES: readonly Axis[] = ['x', 'y', 'z'];

/** Which vertex of a cage lies where another one is mirrored to. */
export interface Mirror {
  readonly axis: 0 | 1 | 2;
  /** The mirror image of each vertex: the vertex itself if it lies on the plane, −1 if no vertex matches. */
  readonly partner: Int32Array;
  readonly share: number;
}

/** How far from its mirrored place a partner may be, in mean lengths of an edge. */
const TOLERANCE = 0.3;

/**
 * Matches the vertices of a rest cage across a plane: of the planes through the origin, the middle of the bounding box and the mean of the vertices, that
 * with the most matches. Two vertices match where each is the nearest to the other's mirrored place.
 */
export function mirrorOf(graph: CageGraph, axis: Axis): Mirror {
  const k = AXES.indexOf(axis) as 0 | 1 | 2;
  const { positions } = graph.cage;
  const along = Array.from({ length: graph.vertices }, (_, v) => positions[3 * v + k]);
  const middle = (Math.min(...along) + Math.max(...along)) / 2;
  const mean = along.reduce((sum, x) => sum + x, 0) / Math.max(1, along.length);
  let best: Mirror | null = null;
  for (const plane of [0, middle, mean]) {
    const mirror = matched(graph, k, plane);
    if (best === null || mirror.share > best.share) best = mirror;
  }
  return best!;
}

function matched(graph: CageGraph, axis: 0 | 1 | 2, plane: number): Mirror {
  const { positions } = graph.cage;
  const nearest = new Int32Array(graph.vertices).fill(-1);
  const mostSquared = (TOLERANCE * graph.meanEdge) ** 2;
  const place = [0, 0, 0];
  for (let v = 0; v < graph.vertices; v++) {
    for (let k = 0; k < 3; k++) place[k] = positions[3 * v + k];
    place[axis] = 2 * plane - place[axis];
    let least = mostSquared;
    for (let other = 0; other < graph.vertices; other++) {
      const dx = positions[3 * other] - place[0];
      const dy = positions[3 * other + 1] - place[1];
      const dz = positions[3 * other + 2] - place[2];
      const squared = dx * dx + dy * dy + dz * dz;
      if (squared > least) continue;
      least = squared;
      nearest[v] = other;
    }
  }
  const partner = nearest.map((other, v) => (other >= 0 && nearest[other] === v ? other : -1));
  const pairs = partner.reduce((count, other) => count + (other >= 0 ? 1 : 0), 0);
  return { axis, partner, share: pairs / Math.max(1, graph.vertices) };
}
