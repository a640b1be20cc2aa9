/**
 * An order of a mesh's vertices in which as many as possible are predicted by parallelograms of vertices before them, over each edge of the mesh: of two
 * triangles with a common edge the two far corners are predicted from each other. `crates/codec/src/parallelograms.rs` is the reference.
 */

import { type ByVertex, byVertex, type Polygons, triangulated } from './polygons';

/** Vertices in order, each with what predicts it. */
export interface Predictions {
  readonly order: Uint32Array;
  /** Triples of the k-th vertex are `triples[3·starts[k] … 3·starts[k + 1])`: the first and the second vertex less the third are where it is expected. */
  readonly starts: Uint32Array;
  readonly triples: readonly number[];
  /** A vertex before the k-th on the mesh, or the one before it; itself for the first. */
  readonly near: Uint32Array;
}

/** For the vertices of these faces; those without a face come last. */
export function parallelogramPredictions(faces: Polygons, points: number): Predictions {
  const triangles = triangulated(faces);
  const pairs = facingCorners(triangles, points);
  return new Ordering(triangles, byVertex(triangles, 3, points), pairs, byVertex(pairs, 4, points), points).run();
}

/** Far corners of two triangles and their common edge, four vertices for each pair of triangles. */
function facingCorners(triangles: Uint32Array, points: number): number[] {
  const farCorners = new Map<number, number>();
  const pairs: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    for (let k = 0; k < 3; k++) {
      const from = triangles[t + k];
      const to = triangles[t + ((k + 1) % 3)];
      const far = triangles[t + ((k + 2) % 3)];
      const other = farCorners.get(to * points + from);
      // Of faces that name a vertex twice nothing is predicted.
      const distinct = from !== to && other !== far && far !== from && far !== to && other !== from && other !== to;
      if (other !== undefined && distinct) pairs.push(far, other, from, to);
      const edge = from * points + to;
      if (!farCorners.has(edge)) farCorners.set(edge, far);
    }
  }
  return pairs;
}

class Ordering {
  private readonly order: Uint32Array;
  private readonly starts: Uint32Array;
  private readonly near: Uint32Array;
  private readonly triples: number[] = [];
  private readonly placed: Uint8Array;
  /** Parallelograms that predict each vertex that is not placed yet. */
  private readonly counts: Uint32Array;
  private readonly queue = new CandidateQueue();
  private length = 0;

  constructor(
    private readonly triangles: Uint32Array,
    private readonly trianglesOf: ByVertex,
    private readonly pairs: readonly number[],
    private readonly pairsOf: ByVertex,
    private readonly points: number,
  ) {
    this.order = new Uint32Array(points);
    this.starts = new Uint32Array(points + 1);
    this.near = new Uint32Array(points);
    this.placed = new Uint8Array(points);
    this.counts = new Uint32Array(points);
  }

  run(): Predictions {
    let seed = 0;
    for (;;) {
      const candidate = this.queue.take();
      if (candidate !== null) {
        const { vertex, near, count } = candidate;
        if (this.placed[vertex] === 0 && count >= this.counts[vertex]) this.place(vertex, near);
        continue;
      }
      while (seed < this.points && (this.placed[seed] === 1 || this.hasNoFace(seed))) seed++;
      if (seed === this.points) break;
      this.place(seed, this.lastOr(seed));
    }
    for (let vertex = 0; vertex < this.points; vertex++) {
      if (this.placed[vertex] === 0) this.add(vertex, this.lastOr(vertex));
    }
    return { order: this.order, starts: this.starts, triples: this.triples, near: this.near };
  }

  private hasNoFace(vertex: number): boolean {
    return this.trianglesOf.starts[vertex] === this.trianglesOf.starts[vertex + 1];
  }

  private lastOr(vertex: number): number {
    return this.length > 0 ? this.order[this.length - 1] : vertex;
  }

  private place(vertex: number, near: number): void {
    const { pairs, placed, triangles, trianglesOf, pairsOf } = this;
    placed[vertex] = 1;
    for (let k = pairsOf.starts[vertex]; k < pairsOf.starts[vertex + 1]; k++) {
      const pair = 4 * pairsOf.items[k];
      const [a, b, from, to] = [pairs[pair], pairs[pair + 1], pairs[pair + 2], pairs[pair + 3]];
      if (placed[from] === 0 || placed[to] === 0) continue;
      if (placed[a] === 1 && placed[b] === 1) {
        if (vertex === a || vertex === b) this.triples.push(from, to, vertex === a ? b : a);
      } else if (placed[a] === 1 || placed[b] === 1) {
        const expected = placed[a] === 1 ? b : a;
        this.counts[expected]++;
        this.queue.add(this.counts[expected], expected, vertex);
      }
    }
    for (let k = trianglesOf.starts[vertex]; k < trianglesOf.starts[vertex + 1]; k++) {
      const triangle = 3 * trianglesOf.items[k];
      for (let corner = 0; corner < 3; corner++) {
        const other = triangles[triangle + corner];
        if (placed[other] === 0 && this.counts[other] === 0) this.queue.add(0, other, vertex);
      }
    }
    this.add(vertex, near);
  }

  private add(vertex: number, near: number): void {
    this.order[this.length] = vertex;
    this.near[this.length] = near;
    this.length++;
    this.starts[this.length] = this.triples.length / 3;
  }
}

/** Vertices that could come next: those of the most parallelograms first, and among equals in the order in which they were added. */
class CandidateQueue {
  /** By their number of parallelograms; vertex and the one near it of each. */
  private readonly queues: { readonly items: number[]; next: number }[] = [];
  private top = -1;

  add(count: number, vertex: number, near: number): void {
    while (this.queues.length <= count) this.queues.push({ items: [], next: 0 });
    this.queues[count].items.push(vertex, near);
    this.top = Math.max(this.top, count);
  }

  take(): { count: number; vertex: number; near: number } | null {
    while (this.top >= 0) {
      const queue = this.queues[this.top];
      if (queue.next < queue.items.length) {
        queue.next += 2;
        return { count: this.top, vertex: queue.items[queue.next - 2], near: queue.items[queue.next - 1] };
      }
      queue.items.length = 0;
      queue.next = 0;
      this.top--;
    }
    return null;
  }
}
