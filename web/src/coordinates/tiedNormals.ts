import type { TriangleMesh } from '../capture';
import { Layers } from './boundaryLayers';

/**
 * Face normals of a deformed cage as functions of its vertices, for `green` (Lipman, Levin and Cohen-Or 2008, Eq. 8): the unit normal of each
 * face times ℓ times the factor s by which the face is stretched, `s² = (|u'|²|v|² − 2 (u'·v')(u·v) + |v'|²|u|²) / 2|u × v|²`. A face without
 * area has the normal 0.
 */
export class TiedNormals {
  private readonly triangles: Uint32Array;
  /** Of each face, what |u'|², u'·v' and |v'|² are multiplied with to give the square of the normal's length. */
  private readonly weights: Float64Array;

  constructor(cage: TriangleMesh) {
    const layers = new Layers(cage);
    const length = layers.normalLength / layers.scale;
    this.triangles = cage.triangles;
    this.weights = new Float64Array(cage.triangles.length);
    const edges = new Float64Array(6);
    for (let f = 0; f < this.weights.length; f += 3) {
      const normal = edgesAndNormal(cage.positions, this.triangles, f, edges);
      const doubleArea = Math.hypot(...normal);
      const factor = (0.5 / doubleArea) * (length / doubleArea) * length;
      const [uu, uv, vv] = products(edges);
      this.weights.set([factor * vv, -2 * factor * uv, factor * uu], f);
    }
  }

  /** Writes the normals of the cage with these vertices, x y z of each face, into `out` from `offset` on. */
  write(vertices: ArrayLike<number>, out: Float32Array | Float64Array, offset: number) {
    const edges = new Float64Array(6);
    for (let f = 0; f < this.weights.length; f += 3) {
      const normal = edgesAndNormal(vertices, this.triangles, f, edges);
      const [uu, uv, vv] = products(edges);
      const squared = this.weights[f] * uu + this.weights[f + 1] * uv + this.weights[f + 2] * vv;
      const scale = Math.sqrt(Math.max(squared, 0)) / Math.hypot(...normal);
      for (let k = 0; k < 3; k++) out[offset + f + k] = Number.isFinite(scale) ? normal[k] * scale : 0;
    }
  }
}

/** Writes the edges u and v of the triangle that begins at corner `first`; returns u × v. */
function edgesAndNormal(
  vertices: ArrayLike<number>,
  triangles: Uint32Array,
  first: number,
  edges: Float64Array,
): [number, number, number] {
  const a = 3 * triangles[first];
  for (let side = 0; side < 2; side++) {
    const b = 3 * triangles[first + 1 + side];
    for (let k = 0; k < 3; k++) edges[3 * side + k] = vertices[b + k] - vertices[a + k];
  }
  const [ux, uy, uz, vx, vy, vz] = edges;
  return [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
}

/** u·u, u·v and v·v. */
function products([ux, uy, uz, vx, vy, vz]: Float64Array): [number, number, number] {
  return [ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz];
}
