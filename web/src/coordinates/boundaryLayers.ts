import type { TriangleMesh } from '../capture';
import { angle } from './angle';
import { diagonalOf, topologyOf } from './topology';
import { cross, dot, norm, pointAt, scaled, sub, type Vector } from './vector';

/** Closer to the plane of a face than this fraction of its longest edge, a point lies in it. */
const IN_PLANE = 1e-13;
/** Largest ratio whose logarithm is taken, at edges, where the integral along the edge is infinite but its factors vanish. */
const LARGEST = 1.329227995784916e36;
/** Numbers kept of each face by {@link Layers.frames}. */
const FRAME = 18;

/**
 * Single and double layer potentials of a closed triangle mesh in closed form (Lipman, Levin and Cohen-Or 2008), as
 * `crates/core/src/coordinates/layer.rs` computes them: from the solid angle Ω of each face and `L = ∫ 1/|r|` along each edge.
 *
 * The mesh is scaled by a power of two to a size near one. Each face has a frame in which its longest edge runs from its first corner, at the
 * origin, to its second, at (length, 0), and the third is at (foot · length, height).
 */
export class Layers {
  /** Factor from the cage's unit of length to that of the scaled mesh. */
  readonly scale: number;
  /** Scaled vertices, x y z each. */
  readonly vertices: Float64Array;
  /** Three vertices of each face, beginning with the ends of its longest edge. */
  readonly corners: Uint32Array;
  /** `4π φ` of each vertex, of the point last asked for. */
  readonly double: Float64Array;
  /** `4π ψ` of each face, in the scaled unit, of the point last asked for. */
  readonly single: Float64Array;
  /** Square root of the mean area of the faces, in the scaled unit: ℓ of docs/FORMAT.md. */
  readonly normalLength: number;
  private readonly edges: Uint32Array;
  private readonly edgeLengths: Float64Array;
  private readonly cornerEdges: Uint32Array;
  private readonly frames: Float64Array;
  private readonly seen: Float64Array;
  private readonly edgeTerms: Float64Array;

  constructor(cage: TriangleMesh) {
    const { edges, triangleEdges } = topologyOf(cage);
    const faces = cage.triangles.length / 3;
    this.scale = 2 ** -Math.min(1000, Math.max(-1000, Math.trunc(Math.log2(diagonalOf(cage.positions)))));
    this.vertices = cage.positions.map((value) => value * this.scale);
    this.edges = edges;
    this.edgeLengths = new Float64Array(edges.length / 2);
    for (let k = 0; k < this.edgeLengths.length; k++) {
      this.edgeLengths[k] = norm(sub(this.vertex(edges[2 * k + 1]), this.vertex(edges[2 * k])));
    }
    this.corners = new Uint32Array(3 * faces);
    this.cornerEdges = new Uint32Array(3 * faces);
    this.frames = new Float64Array(FRAME * faces);
    let area = 0;
    for (let f = 0; f < faces; f++) {
      this.prepareFace(f, cage.triangles.subarray(3 * f, 3 * f + 3), triangleEdges.subarray(3 * f, 3 * f + 3));
      area += 0.5 * this.frames[FRAME * f + 9] * this.frames[FRAME * f + 10];
    }
    this.normalLength = Math.sqrt(area / Math.max(1, faces));
    this.double = new Float64Array(this.vertices.length / 3);
    this.single = new Float64Array(faces);
    this.seen = new Float64Array((4 * this.vertices.length) / 3);
    this.edgeTerms = new Float64Array(edges.length);
  }

  private vertex(index: number): Vector {
    return pointAt(this.vertices, index);
  }

  private prepareFace(f: number, corners: Uint32Array, edges: Uint32Array) {
    const place = [0, 1, 2].map((i) => this.vertex(corners[i]));
    const lengths = [0, 1, 2].map((i) => norm(sub(place[(i + 2) % 3], place[(i + 1) % 3])));
    let top = 0;
    for (let i = 1; i < 3; i++) if (lengths[i] > lengths[top]) top = i;
    const order = [(top + 1) % 3, (top + 2) % 3, top];
    const [v0, v1, v2] = order.map((i) => place[i]);
    // The sides that meet opposite the longest edge are the shortest two: their product rounds least.
    const product = cross(sub(v0, v2), sub(v1, v2));
    const doubleArea = norm(product);
    const length = lengths[top];
    const along = scaled(sub(v1, v0), 1 / length);
    const normal = scaled(product, 1 / doubleArea);
    const across = cross(normal, along);
    const height = doubleArea / length;
    const reach = dot(sub(v2, v0), along);
    const [first, second] = [lengths[order[0]], lengths[order[1]]];
    const shape = [length, height, reach / length, doubleArea / first, doubleArea / second];
    const sideNormals = [height / first, (length - reach) / first, -height / second, reach / second];
    this.frames.set([...along, ...across, ...normal, ...shape, ...sideNormals], FRAME * f);
    order.forEach((i, k) => {
      this.corners[3 * f + k] = corners[i];
      this.cornerEdges[3 * f + k] = edges[i];
    });
  }

  /** Outward unit normal of a face. */
  normal(face: number): Vector {
    return [this.frames[FRAME * face + 6], this.frames[FRAME * face + 7], this.frames[FRAME * face + 8]];
  }

  /** Affine coordinates of a scaled point with respect to a face's corners, in the order of {@link corners}, and its height over the face. */
  affineCoordinates(face: number, point: Vector): [number, number, number, number] {
    const at = FRAME * face;
    const x = sub(point, this.vertex(this.corners[3 * face]));
    const [p, q, h] = [0, 3, 6].map((axis) => dot(pointAt(this.frames, (at + axis) / 3), x));
    const across = q / this.frames[at + 10];
    const second = p / this.frames[at + 9] - this.frames[at + 11] * across;
    return [1 - second - across, second, across, h];
  }

  /** Computes {@link double} and {@link single} for a scaled point. */
  evaluate(x: number, y: number, z: number) {
    const { vertices, edges, edgeLengths, seen, edgeTerms, frames, corners, cornerEdges, double, single } = this;
    for (let j = 0; j < double.length; j++) {
      const rx = vertices[3 * j] - x;
      const ry = vertices[3 * j + 1] - y;
      const rz = vertices[3 * j + 2] - z;
      seen[4 * j] = rx;
      seen[4 * j + 1] = ry;
      seen[4 * j + 2] = rz;
      seen[4 * j + 3] = Math.sqrt(rx * rx + ry * ry + rz * rz);
    }
    double.fill(0);
    for (let k = 0; k < edgeLengths.length; k++) {
      const a = 4 * edges[2 * k];
      const b = 4 * edges[2 * k + 1];
      const cosine = seen[a] * seen[b] + seen[a + 1] * seen[b + 1] + seen[a + 2] * seen[b + 2];
      const product = seen[a + 3] * seen[b + 3];
      const far = seen[a + 3] + seen[b + 3];
      const near = edgeLengths[k] / far;
      edgeTerms[2 * k] =
        near < 0.3 ? Math.log1p((2 * near) / (1 - near)) : farLogarithm(seen, a, b, edgeLengths[k], product, cosine);
      edgeTerms[2 * k + 1] = cosine;
    }
    for (let f = 0; f < single.length; f++) {
      const at = FRAME * f;
      const v0 = corners[3 * f];
      const v1 = corners[3 * f + 1];
      const v2 = corners[3 * f + 2];
      const e0 = 2 * cornerEdges[3 * f];
      const e1 = 2 * cornerEdges[3 * f + 1];
      const e2 = 2 * cornerEdges[3 * f + 2];
      const l0 = edgeTerms[e0];
      const l1 = edgeTerms[e1];
      const l2 = edgeTerms[e2];
      const rx = seen[4 * v0];
      const ry = seen[4 * v0 + 1];
      const rz = seen[4 * v0 + 2];
      const p = rx * frames[at] + ry * frames[at + 1] + rz * frames[at + 2];
      const q = rx * frames[at + 3] + ry * frames[at + 4] + rz * frames[at + 5];
      const h = rx * frames[at + 6] + ry * frames[at + 7] + rz * frames[at + 8];
      const length = frames[at + 9];
      const height = frames[at + 10];
      const foot = frames[at + 11];
      const d0 = seen[4 * v0 + 3];
      const d1 = seen[4 * v1 + 3];
      const d2 = seen[4 * v2 + 3];
      const cosine = d0 * d1 * d2 + edgeTerms[e0 + 1] * d0 + edgeTerms[e1 + 1] * d1 + edgeTerms[e2 + 1] * d2;
      const half = angle(Math.abs(h * length * height), cosine);
      const least = IN_PLANE * length;
      const omega = h > least ? 2 * half : h < -least ? -2 * half : 0;
      const across = q / height;
      const first = p / length;
      const wx = l0 * frames[at + 14] + l1 * frames[at + 16];
      const wy = l0 * frames[at + 15] + l1 * frames[at + 17] - l2;
      const s = across * omega + (h * wy) / height;
      const t = first * omega + (h * wx) / length;
      const second = s * foot - t;
      double[v2] -= s;
      double[v1] += second;
      double[v0] += omega + s - second;
      const weight1 = across * foot - first;
      const weight0 = across - weight1 + 1;
      single[f] = weight0 * frames[at + 12] * l0 + weight1 * frames[at + 13] * l1 - q * l2 - h * omega;
    }
  }
}

/** `L` of an edge that is not seen from far away: |a||b| + a·b is taken without cancellation between the ends as well, as |a × b|² / (|a||b| − a·b). */
function farLogarithm(
  seen: Float64Array,
  a: number,
  b: number,
  length: number,
  product: number,
  cosine: number,
): number {
  const sum = seen[a + 3] + seen[b + 3] + length;
  let top = sum * sum;
  let bottom = 2 * (product + cosine);
  if (cosine < 0) {
    const cx = seen[a + 1] * seen[b + 2] - seen[a + 2] * seen[b + 1];
    const cy = seen[a + 2] * seen[b] - seen[a] * seen[b + 2];
    const cz = seen[a] * seen[b + 1] - seen[a + 1] * seen[b];
    top *= product - cosine;
    bottom = 2 * (cx * cx + cy * cy + cz * cz);
  }
  return Math.log(top / Math.max(bottom, top / LARGEST));
}
