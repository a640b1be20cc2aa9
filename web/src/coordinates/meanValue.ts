import type { TriangleMesh } from '../capture';
import { angle, halfAngleOverSine, SMALL_ANGLE_COSINE } from './angle';
import { integratedWeights } from './meanValueIntegral';
import { diagonalOf, topologyOf } from './topology';
import { dot, norm, pointAt, scaled, type Vector } from './vector';

/** Fills one row of Φ, the coordinates of the point (x, y, z), into `out` from `offset` on. */
export type RowOf = (x: number, y: number, z: number, out: Float64Array, offset: number) => void;

/** Closer to a vertex than this fraction of the cage's diagonal, a point has the coordinates of the vertex. */
const VERTEX_TOLERANCE = 1e-13;
/** A point that sees an edge under an angle whose sine is below this, from between its ends, lies on the edge. */
const EDGE_TOLERANCE = 1e-11;
/** Estimated error of an entry from which the weights of a face are integrated. */
const ENTRY_TOLERANCE = 1e-11;
/** Length of a face's mean vector from which a point is so near to the face that the closed form does not cancel. */
const LARGE = 0.1;
/** What takes the place of 1/0 where a point lies on a face. */
const HUGE = 1e100;

/**
 * Mean value coordinates of a closed triangle mesh (Ju, Schaefer and Warren 2005) in mean-vector form, as `crates/core/src/coordinates/mean_value`
 * computes them: a face with unit vectors `u_i` to its corners has the mean vector `m = ½ Σ θ_e n_e` over its edges, and its weights
 * `w_i = m·(u_j × u_k) / (det d_i)`. Points on a vertex, an edge or a face have the coordinates of that vertex, edge or face.
 */
export function meanValueRows(cage: TriangleMesh): RowOf {
  const { positions, triangles } = cage;
  const { edges, triangleEdges, signs } = topologyOf(cage);
  const vertices = positions.length / 3;
  const edgeCount = edges.length / 2;
  const nearVertex = VERTEX_TOLERANCE * diagonalOf(positions);
  const directions = new Float64Array(3 * vertices);
  const nearness = new Float64Array(vertices);
  // Of each edge u_a × u_b, and the factor that turns it into ½ θ n.
  const edgeTerms = new Float64Array(4 * edgeCount);

  function face(first: number, x: Vector, total: number): [number, number, number] {
    const product = [0, 1, 2].map((i): Vector => {
      const [e, sign] = [4 * triangleEdges[first + i], signs[first + i]];
      return [sign * edgeTerms[e], sign * edgeTerms[e + 1], sign * edgeTerms[e + 2]];
    });
    const g = product.map((v, i) => scaled(v, edgeTerms[4 * triangleEdges[first + i] + 3]));
    const near = [0, 1, 2].map((i) => nearness[triangles[first + i]]);
    const mean: Vector = [g[0][0] + g[1][0] + g[2][0], g[0][1] + g[1][1] + g[2][1], g[0][2] + g[1][2] + g[2][2]];
    const det = dot(pointAt(directions, triangles[first]), product[0]);
    const loss2 = (dot(g[0], g[0]) + dot(g[1], g[1])) / (det * det);
    if (norm(mean) < LARGE && isInaccurate(loss2, Math.max(near[0], near[1], near[2]), total)) {
      const corners = [0, 1, 2].map((i) => pointAt(positions, triangles[first + i]));
      const weights = integratedWeights([corners[0], corners[1], corners[2]], x);
      return [weights[0] / near[0], weights[1] / near[1], weights[2] / near[2]];
    }
    const numerators: [number, number, number] = [dot(mean, product[0]), dot(mean, product[1]), dot(mean, product[2])];
    const weights: [number, number, number] = [numerators[0] / det, numerators[1] / det, numerators[2] / det];
    // On the face itself only the ratios of the weights count.
    return weights.every(Number.isFinite)
      ? weights
      : [numerators[0] * HUGE, numerators[1] * HUGE, numerators[2] * HUGE];
  }

  /** Computes the weights anew, integrated for faces whose rounding matters, where all of them add up to about `total`; returns their sum. */
  function accurateWeights(x: Vector, total: number, out: Float64Array, offset: number): number {
    out.fill(0, offset, offset + vertices);
    for (let first = 0; first < triangles.length; first += 3) {
      const weights = face(first, x, total);
      for (let i = 0; i < 3; i++) out[offset + triangles[first + i]] += weights[i] * nearness[triangles[first + i]];
    }
    let sum = 0;
    for (let j = 0; j < vertices; j++) sum += out[offset + j];
    return sum;
  }

  return (x, y, z, out, offset) => {
    out.fill(0, offset, offset + vertices);
    for (let j = 0; j < vertices; j++) {
      const rx = positions[3 * j] - x;
      const ry = positions[3 * j + 1] - y;
      const rz = positions[3 * j + 2] - z;
      const d = Math.sqrt(rx * rx + ry * ry + rz * rz);
      if (d <= nearVertex) {
        out.fill(0, offset, offset + vertices);
        out[offset + j] = 1;
        return;
      }
      const inverse = 1 / d;
      nearness[j] = inverse;
      directions[3 * j] = rx * inverse;
      directions[3 * j + 1] = ry * inverse;
      directions[3 * j + 2] = rz * inverse;
    }
    for (let k = 0; k < edgeCount; k++) {
      const a = 3 * edges[2 * k];
      const b = 3 * edges[2 * k + 1];
      const ax = directions[a];
      const ay = directions[a + 1];
      const az = directions[a + 2];
      const bx = directions[b];
      const by = directions[b + 1];
      const bz = directions[b + 2];
      const cx = ay * bz - az * by;
      const cy = az * bx - ax * bz;
      const cz = ax * by - ay * bx;
      const square = cx * cx + cy * cy + cz * cz;
      const t = ax * bx + ay * by + az * bz;
      edgeTerms[4 * k] = cx;
      edgeTerms[4 * k + 1] = cy;
      edgeTerms[4 * k + 2] = cz;
      if (t > SMALL_ANGLE_COSINE) {
        edgeTerms[4 * k + 3] = halfAngleOverSine(square);
        continue;
      }
      const s = Math.sqrt(square);
      if (s < EDGE_TOLERANCE && t < 0) {
        const toA = 1 / nearness[a / 3];
        const toB = 1 / nearness[b / 3];
        out.fill(0, offset, offset + vertices);
        out[offset + a / 3] = toB / (toA + toB);
        out[offset + b / 3] = toA / (toA + toB);
        return;
      }
      edgeTerms[4 * k + 3] = (0.5 * angle(s, t)) / s;
    }
    // The largest square of what the determinant of a face amplifies rounding by.
    let loss2 = 1;
    for (let f = 0; f < triangles.length; f += 3) {
      const e0 = 4 * triangleEdges[f];
      const e1 = 4 * triangleEdges[f + 1];
      const e2 = 4 * triangleEdges[f + 2];
      const h0 = signs[f] * edgeTerms[e0 + 3];
      const h1 = signs[f + 1] * edgeTerms[e1 + 3];
      const h2 = signs[f + 2] * edgeTerms[e2 + 3];
      const c0x = edgeTerms[e0];
      const c0y = edgeTerms[e0 + 1];
      const c0z = edgeTerms[e0 + 2];
      const c1x = edgeTerms[e1];
      const c1y = edgeTerms[e1 + 1];
      const c1z = edgeTerms[e1 + 2];
      const c2x = edgeTerms[e2];
      const c2y = edgeTerms[e2 + 1];
      const c2z = edgeTerms[e2 + 2];
      const mx = h0 * c0x + h1 * c1x + h2 * c2x;
      const my = h0 * c0y + h1 * c1y + h2 * c2y;
      const mz = h0 * c0z + h1 * c1z + h2 * c2z;
      const v0 = triangles[f];
      const v1 = triangles[f + 1];
      const v2 = triangles[f + 2];
      const inverse =
        signs[f] / (directions[3 * v0] * c0x + directions[3 * v0 + 1] * c0y + directions[3 * v0 + 2] * c0z);
      const squares = h0 * h0 * (c0x * c0x + c0y * c0y + c0z * c0z) + h1 * h1 * (c1x * c1x + c1y * c1y + c1z * c1z);
      const own = squares * inverse * inverse;
      if (own > loss2) loss2 = own;
      out[offset + v0] += signs[f] * (mx * c0x + my * c0y + mz * c0z) * inverse * nearness[v0];
      out[offset + v1] += signs[f + 1] * (mx * c1x + my * c1y + mz * c1z) * inverse * nearness[v1];
      out[offset + v2] += signs[f + 2] * (mx * c2x + my * c2y + mz * c2z) * inverse * nearness[v2];
    }
    let total = 0;
    let nearest = 0;
    for (let j = 0; j < vertices; j++) {
      total += out[offset + j];
      if (nearness[j] > nearest) nearest = nearness[j];
    }
    if (isInaccurate(loss2, nearest, total)) total = accurateWeights([x, y, z], total, out, offset);
    const scale = 1 / total;
    for (let j = 0; j < vertices; j++) out[offset + j] *= scale;
  };
}

/** Whether rounding may change entries by more than the tolerance: from what a face's determinant amplifies it by (squared), the nearest vertex and the sum. */
function isInaccurate(loss2: number, nearest: number, total: number): boolean {
  const error = (Number.EPSILON * Math.sqrt(loss2) * nearest) / Math.abs(total);
  return Number.isNaN(error) || error > ENTRY_TOLERANCE;
}
