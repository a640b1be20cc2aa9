import type { TriangleMesh } from '../capture';

/** How far away a vertex is: along the edges of the cage, or straight through space. */
export type FalloffMeasure = 'surface' | 'space';

/** The vertices of a cage and the edges between them. */
export class CageGraph {
  readonly vertices: number;
  /** Mean length of the edges. */
  readonly meanEdge: number;
  private readonly neighbours: readonly (readonly number[])[];

  constructor(readonly cage: TriangleMesh) {
    this.vertices = cage.positions.length / 3;
    const neighbours = Array.from({ length: this.vertices }, () => new Set<number>());
    const { triangles } = cage;
    for (let corner = 0; corner < triangles.length; corner++) {
      const [a, b] = [triangles[corner], triangles[corner - (corner % 3) + ((corner + 1) % 3)]];
      neighbours[a].add(b);
      neighbours[b].add(a);
    }
    this.neighbours = neighbours.map((set) => [...set]);
    let [sum, count] = [0, 0];
    this.neighbours.forEach((others, a) =>
      others.forEach((b) => {
        sum += this.between(a, b);
        count++;
      }),
    );
    this.meanEdge = sum / Math.max(1, count);
  }

  /** Straight distance of two vertices. */
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
      for (const next of this.neighbours[nearest]) {
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
