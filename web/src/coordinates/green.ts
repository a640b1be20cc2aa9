import type { TriangleMesh } from '../capture';
import { Layers } from './boundaryLayers';
import type { RowOf } from './meanValue';
import { dot, pointAt, squaredDistanceToTriangle, sub, type Vector } from './vector';

const INVERSE_4PI = 1 / (4 * Math.PI);
/** Rows whose φ sum to one within this need nothing added. */
const COMPLETE = 1e-13;
/** Faces whose distances differ by less than this fraction, as they do at a common edge, are equally near. */
const EQUALLY_NEAR = 1e-9;
/** Points closer to the cage than this fraction of its size lie on it. */
const ON_CAGE = 1e-13;

/**
 * Green coordinates of a closed triangle mesh (Lipman, Levin and Cohen-Or 2008), as `crates/core/src/coordinates/green.rs` computes them: φ of the
 * vertices, then ψ of the faces divided by ℓ, the root of the faces' mean area. What the φ lack of a sum of one, on the cage and outside it, is
 * distributed over the nearest face by the affine coordinates of the point.
 */
export function greenRows(cage: TriangleMesh): RowOf {
  const layers = new Layers(cage);
  const { double, single, normalLength } = layers;
  const vertices = double.length;
  return (x, y, z, out, offset) => {
    const point: Vector = [x * layers.scale, y * layers.scale, z * layers.scale];
    layers.evaluate(...point);
    let total = 0;
    for (let j = 0; j < vertices; j++) {
      out[offset + j] = double[j] * INVERSE_4PI;
      total += out[offset + j];
    }
    for (let f = 0; f < single.length; f++) out[offset + vertices + f] = (single[f] * INVERSE_4PI) / normalLength;
    const missing = 1 - total;
    if (Math.abs(missing) <= COMPLETE) return;
    for (const [face, share] of nearestFaces(layers, point, missing)) {
      const weights = layers.affineCoordinates(face, point);
      for (let i = 0; i < 3; i++) out[offset + layers.corners[3 * face + i]] += missing * share * weights[i];
      out[offset + vertices + face] += (missing * share * weights[3]) / normalLength;
    }
  };
}

/** The nearest faces, several where a shared edge or vertex is nearest, and the share of each, which falls with the angle under which it is seen. */
function nearestFaces(layers: Layers, x: Vector, missing: number): [number, number][] {
  const corner = (face: number, i: number) => pointAt(layers.vertices, layers.corners[3 * face + i]);
  const distances = Array.from(layers.single, (_, f) =>
    squaredDistanceToTriangle(corner(f, 0), corner(f, 1), corner(f, 2), x),
  );
  const least = distances.reduce((a, b) => Math.min(a, b), Infinity);
  const bound = least * (1 + EQUALLY_NEAR) + ON_CAGE * ON_CAGE;
  const distance = Math.sqrt(least);
  const found: [number, number][] = [];
  let sum = 0;
  distances.forEach((value, face) => {
    if (!(value <= bound)) return;
    const height = dot(sub(x, corner(face, 0)), layers.normal(face)) * Math.sign(missing);
    const share = distance <= ON_CAGE ? 1 : 1 / (Math.max(1 - height / distance, 0) + EQUALLY_NEAR);
    found.push([face, share]);
    sum += share;
  });
  return found.map(([face, share]) => [face, share / sum]);
}
