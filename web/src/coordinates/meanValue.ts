import type { TriangleMesh } from '../capture';
import { angle } from './angle';
import { integratedWeights } from './meanValueIntegral';
import { diagonalOf, topologyOf } from './topology';
import { pointAt, type Vector } from './vector';

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
 * Mean value coordinates of a closed triangle mesh (Ju, Schaefer and Warren 2005) in mean-vector form, as `core/src/coordinates/mean_value`
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
  // Of each edge ½ θ n, and the factor that turns it into u_a × u_b.
  const edgeTerms = new Float64Array(4 * edgeCount);

  function face(first: number, x: Vector, total: number): [number, number, number] {
    const g = [0, 1, 2].map((i): Vector => {
      const [e, sign] = [4 * triangleEdges[first + i], signs[first + i]];
      return [sign * edgeTerms[e], sign * edgeTerms[e + 1], sign * edgeTerms[e + 2]];
    });
    const back = [0, 1, 2].map((i) => edgeTerms[4 * triangleEdges[first + i] + 3]);
    const near = [0, 1, 2].map((i) => nearness[triangles[first + i]]);
    const mean = [0, 1, 2].map((k) => g[0][k] + g[1][k] + g[2][k]);
    const u = 3 * triangles[first];
    const det = (directions[u] * g[0][0] + directions[u + 1] * g[0][1] + directions[u + 2] * g[0][2]) * back[0];
    const squares = (v: readonly number[]) => v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    const loss2 = (squares(g[0]) + squares(g[1])) / (det * det);
    if (Math.sqrt(squares(mean)) < LARGE && isInaccurate(loss2, Math.max(near[0], near[1], near[2]), total)) {
      const corners = [0, 1, 2].map((i) => pointAt(positions, triangles[first + i]));
      const weights = integratedWeights([corners[0], corners[1], corners[2]], x);
      return [weights[0] / near[0], weights[1] / near[1], weights[2] / near[2]];
    }
    const numerator = (i: number) => (mean[0] * g[i][0] + mean[1] * g[i][1] + mean[2] * g[i][2]) * back[i];
    const numerators: [number, number, number] = [numerator(0), numerator(1), numerator(2)];
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
      const s = Math.sqrt(cx * cx + cy * cy + cz * cz);
      const t = ax * bx + ay * by + az * bz;
      if (s < EDGE_TOLERANCE && t < 0) {
        const toA = 1 / nearness[a / 3];
        const toB = 1 / nearness[b / 3];
        out.fill(0, offset, offset + vertices);
        out[offset + a / 3] = toB / (toA + toB);
        out[offset + b / 3] = toA / (toA + toB);
        return;
      }
      const theta = angle(s, t);
      const regular = theta * s > 0;
      const half = regular ? (0.5 * theta) / s : 0.5;
      edgeTerms[4 * k] = cx * half;
      edgeTerms[4 * k + 1] = cy * half;
      edgeTerms[4 * k + 2] = cz * half;
      edgeTerms[4 * k + 3] = regular ? (2 * s) / theta : 2;
    }
    // The largest square of what the determinant of a face amplifies rounding by.
    let loss2 = 1;
    for (let f = 0; f < triangles.length; f += 3) {
      const e0 = 4 * triangleEdges[f];
      const e1 = 4 * triangleEdges[f + 1];
      const e2 = 4 * triangleEdges[f + 2];
      const s0 = signs[f];
      const s1 = signs[f + 1];
      const s2 = signs[f + 2];
      const g0x = s0 * edgeTerms[e0];
      const g0y = s0 * edgeTerms[e0 + 1];
      const g0z = s0 * edgeTerms[e0 + 2];
      const g1x = s1 * edgeTerms[e1];
      const g1y = s1 * edgeTerms[e1 + 1];
      const g1z = s1 * edgeTerms[e1 + 2];
      const g2x = s2 * edgeTerms[e2];
      const g2y = s2 * edgeTerms[e2 + 1];
      const g2z = s2 * edgeTerms[e2 + 2];
      const mx = g0x + g1x + g2x;
      const my = g0y + g1y + g2y;
      const mz = g0z + g1z + g2z;
      const v0 = triangles[f];
      const v1 = triangles[f + 1];
      const v2 = triangles[f + 2];
      const back0 = edgeTerms[e0 + 3];
      const det = (directions[3 * v0] * g0x + directions[3 * v0 + 1] * g0y + directions[3 * v0 + 2] * g0z) * back0;
      const inverse = 1 / det;
      const own = (g0x * g0x + g0y * g0y + g0z * g0z + g1x * g1x + g1y * g1y + g1z * g1z) * inverse * inverse;
      if (own > loss2) loss2 = own;
      out[offset + v0] += (mx * g0x + my * g0y + mz * g0z) * back0 * inverse * nearness[v0];
      out[offset + v1] += (mx * g1x + my * g1y + mz * g1z) * edgeTerms[e1 + 3] * inverse * nearness[v1];
      out[offset + v2] += (mx * g2x + my * g2y + mz * g2z) * edgeTerms[e2 + 3] * inverse * nearness[v2];
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
