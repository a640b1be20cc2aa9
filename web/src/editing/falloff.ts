import type { TriangleMesh } from '../capture';
import { adjacency, type ByVertex, polygonsOf } from '../codec/polygons';

/** How far away a vertex is: along the edges of the cage, or straight through space. */
export type FalloffMeasure = 'surface' | 'space';

export class CageGraph {
  readonly vertices: number;
  readonly meanEdge: number;
  private readonly neighbours: ByVertex;

  constructor(readonly cage: TriangleMesh) {
    this.vertices = cage.positions.length / 3;
    this.neighbours = adjacency(polygonsOf(cage.triangles), this.vertices);
    let sum = 0;
    for (let v = 0; v < this.vertices; v++) for (const other of this.around(v)) sum += this.between(v, other);
    this.meanEdge = sum / Math.max(1, this.neighbours.items.length);
  }

  private around(vertex: number): Uint32Array {
    const { starts, items } = this.neighbours;
    return items.subarray(starts[vertex], starts[vertex + 1]);
  }

  between(a: number, b: number): number {
    const { positions: p } = this.cage;
    return Math.hypot(p[3 * a] - p[3 * b], p[3 * a + 1] - p[3 * b + 1], p[3 * a + 2] - p[3 * b + 2]);
  }

  /** Distance of each vertex from the nearest of some, infinite beyond `farthest`. */
  distances(from: readonly number[], farthest: number, measure: FalloffMeasure): Float64Array {
    const distances = new Float64Array(this.vertices).fill(Infinity);
    if (measure === 'space') {
      for (let v = 0; v < this.vertices; v++) {
        for (const source of from) distances[v] = Math.min(distances[v], this.between(source, v));
        if (distances[v] > farthest) distances[v] = Infinity;
      }
      return distances;
    }
    for (const source of from) distances[source] = 0;
    // Dijkstra (1959); cages are small enough for a plain search of the nearest.
    const open = new Set(from);
    while (open.size > 0) {
      let nearest = -1;
      for (const v of open) if (nearest < 0 || distances[v] < distances[nearest]) nearest = v;
      open.delete(nearest);
      for (const next of this.around(nearest)) {
        const distance = distances[nearest] + this.between(nearest, next);
        if (distance >= distances[next] || distance > farthest) continue;
        distances[next] = distance;
        open.add(next);
      }
    }
    return distances;
  }
}

/** How much each vertex follows those that are moved: 1 at these, (1 − (d/r)²)² at distance d, and nothing from the radius r on. */
export function falloffWeights(
  graph: CageGraph,
  moved: readonly number[],
  radius: number,
  measure: FalloffMeasure,
): Float64Array {
  const weights = graph.distances(moved, radius, measure);
  for (let v = 0; v < weights.length; v++) {
    const share = weights[v] === 0 ? 0 : weights[v] / radius;
    weights[v] = share < 1 ? (1 - share * share) ** 2 : 0;
  }
  return weights;
}
