/**
 * An order of a mesh's vertices from coarse to fine, in which each is predicted from neighbours on the mesh that come before it. Independent vertices are taken
 * away round by round, those of few neighbours first; the neighbours of one that is gone are joined to the one of them that has the fewest.
 * `crates/codec/src/hierarchy.rs` is the reference.
 */

import { adjacency, type Polygons } from './polygons';

/** Rounds end when so few vertices are left; these are not predicted. */
const COARSEST = 48;

/** Vertices from coarse to fine: parents of the k-th are `parents[starts[k] … starts[k + 1])`, all of them before it. */
export interface Hierarchy {
  readonly order: Uint32Array;
  readonly starts: Uint32Array;
  readonly parents: Uint32Array;
}

/** Of the vertices of these faces; without an edge a vertex is not predicted. */
export function vertexHierarchy(faces: Polygons, points: number): Hierarchy {
  const near = neighbours(faces, points);
  /** Ascending. */
  let left = Uint32Array.from({ length: points }, (_, v) => v);
  const removed: number[] = [];
  const parentsOf: number[][] = [];
  const blocked = new Uint32Array(points);
  const gone = new Uint8Array(points);
  for (let round = 1; left.length > COARSEST; round++) {
    const before = removed.length;
    for (const v of fewestNeighboursFirst(left, near)) {
      if (blocked[v] !== round && near[v].length > 0) {
        blocked[v] = round;
        for (const w of near[v]) blocked[w] = round;
        removed.push(v);
      }
    }
    if (removed.length === before) break;
    for (let k = before; k < removed.length; k++) {
      const v = removed[k];
      gone[v] = 1;
      parentsOf.push(near[v]);
      near[v] = [];
      join(near, v, parentsOf[k]);
    }
    left = left.filter((v) => gone[v] === 0);
  }
  const order = new Uint32Array(points);
  order.set(left);
  const starts = new Uint32Array(points + 1);
  const parents: number[] = [];
  for (let k = removed.length - 1, at = left.length; k >= 0; k--, at++) {
    order[at] = removed[k];
    for (const parent of parentsOf[k]) parents.push(parent);
    starts[at + 1] = parents.length;
  }
  return { order, starts, parents: Uint32Array.from(parents) };
}

/** Vertices that an edge leads to, ascending. */
function neighbours(faces: Polygons, points: number): number[][] {
  const { starts, items } = adjacency(faces, points);
  return Array.from({ length: points }, (_, v) => [...items.subarray(starts[v], starts[v + 1]).sort()]);
}

/** These vertices by their number of neighbours, equal ones in their order. */
function fewestNeighboursFirst(vertices: Uint32Array, near: readonly (readonly number[])[]): Uint32Array {
  const places: number[] = [];
  for (const v of vertices) {
    const count = near[v].length;
    while (places.length <= count + 1) places.push(0);
    places[count + 1]++;
  }
  for (let k = 1; k < places.length; k++) places[k] += places[k - 1];
  const sorted = new Uint32Array(vertices.length);
  for (const v of vertices) sorted[places[near[v].length]++] = v;
  return sorted;
}

/** Takes v from the lists of its neighbours and joins these to the one that has the fewest. */
function join(near: readonly number[][], v: number, neighboursOfV: readonly number[]): void {
  let hub = -1;
  for (const w of neighboursOfV) {
    const list = near[w];
    const place = lowerBound(list, v);
    if (list[place] === v) list.splice(place, 1);
    if (hub < 0 || list.length < near[hub].length || (list.length === near[hub].length && w < hub)) hub = w;
  }
  for (const w of neighboursOfV) {
    if (w !== hub) {
      insert(near[hub], w);
      insert(near[w], hub);
    }
  }
}

function insert(ascending: number[], x: number): void {
  const place = lowerBound(ascending, x);
  if (ascending[place] !== x) ascending.splice(place, 0, x);
}

/** Number of entries below x. */
function lowerBound(ascending: readonly number[], x: number): number {
  let [low, high] = [0, ascending.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (ascending[middle] < x) low = middle + 1;
    else high = middle;
  }
  return low;
}
