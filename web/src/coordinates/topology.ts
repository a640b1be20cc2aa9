import type { TriangleMesh } from '../capture';

/** Edges of a closed triangle mesh, each shared by the two triangles beside it. */
export interface Topology {
  /** Two vertices of each edge, in the direction of the triangle that comes first. */
  readonly edges: Uint32Array;
  /** Three edges of each triangle; number i is opposite corner i. */
  readonly triangleEdges: Uint32Array;
  /** 1 where the triangle goes along the edge from corner i+1 to corner i+2, −1 where it goes against it. */
  readonly signs: Int8Array;
}

/** Finds the edges of a cage. Throws where an index is out of range or the mesh is not closed. */
export function topologyOf(cage: TriangleMesh): Topology {
  const { triangles } = cage;
  const vertices = cage.positions.length / 3;
  const found = new Map<number, number>();
  const edges: number[] = [];
  const triangleEdges = new Uint32Array(triangles.length);
  const signs = new Int8Array(triangles.length);
  for (let corner = 0; corner < triangles.length; corner++) {
    const first = corner - (corner % 3);
    const from = triangles[first + ((corner + 1) % 3)];
    const to = triangles[first + ((corner + 2) % 3)];
    if (from >= vertices || to >= vertices) {
      throw new Error(
        `Triangle ${first / 3} of the cage names a vertex that does not exist; encode the capture again.`,
      );
    }
    const opposite = found.get(to * vertices + from);
    if (opposite !== undefined) {
      triangleEdges[corner] = opposite;
      signs[corner] = -1;
      found.delete(to * vertices + from);
    } else {
      triangleEdges[corner] = edges.length / 2;
      signs[corner] = 1;
      found.set(from * vertices + to, edges.length / 2);
      edges.push(from, to);
    }
  }
  if (found.size > 0) throw new Error('The cage is not closed: repair it with cager cage --repair and encode again.');
  return { edges: Uint32Array.from(edges), triangleEdges, signs };
}

/** Lowest and highest coordinates of points, x y z each, along every axis; infinite the wrong way round of none. */
export function boundsOf(positions: ArrayLike<number>): { readonly low: number[]; readonly high: number[] } {
  const [low, high] = [Array<number>(3).fill(Infinity), Array<number>(3).fill(-Infinity)];
  for (let k = 0; k < positions.length; k++) {
    low[k % 3] = Math.min(low[k % 3], positions[k]);
    high[k % 3] = Math.max(high[k % 3], positions[k]);
  }
  return { low, high };
}

/** Length of the diagonal of the axis-parallel bounding box of points, x y z each; 0 for none. */
export function diagonalOf(positions: ArrayLike<number>): number {
  const { low, high } = boundsOf(positions);
  return Math.sqrt(low.reduce((sum, least, k) => sum + Math.max(0, high[k] - least) ** 2, 0));
}

/** The middle of the bounding box of points, x y z each; the origin for none. */
export function middleOf(positions: ArrayLike<number>): [number, number, number] {
  const { low, high } = boundsOf(positions);
  const at = (k: number) => (high[k] >= low[k] ? low[k] / 2 + high[k] / 2 : 0);
  return [at(0), at(1), at(2)];
}
