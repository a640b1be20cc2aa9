import type { StaticPart } from '../capture';
import { byVertex } from '../codec/byVertex';
import { triangulated } from '../codec/polygons';

/** The model's polygons, prepared for drawing and for normals. */
export interface Surface {
  /** Three points of each triangle; polygons are cut into fans. */
  readonly triangles: Uint32Array;
  /** Two points of each edge of the polygons, each edge once. */
  readonly edges: Uint32Array;
  /** The triangles around point p are `fans[2·fanStarts[p] … 2·fanStarts[p + 1])`: the other two corners of each, in order. */
  readonly fanStarts: Uint32Array;
  readonly fans: Uint32Array;
}

/** Prepares the polygons of a model. Throws where a corner names a point that does not exist. */
export function surfaceOf(model: Pick<StaticPart, 'rest' | 'cornerCounts' | 'corners'>): Surface {
  const points = model.rest.length / 3;
  const { corners, cornerCounts } = model;
  for (let k = 0; k < corners.length; k++) {
    if (corners[k] >= points)
      throw new Error(`A face names point ${corners[k]}, but the model has ${points}; encode it again.`);
  }
  const triangles = triangulated({ counts: cornerCounts, corners });
  const edgeKeys = new Float64Array(corners.length);
  let at = 0;
  for (const count of cornerCounts) {
    for (let k = 0; k < count; k++) {
      const [a, b] = [corners[at + k], corners[at + ((k + 1) % count)]];
      edgeKeys[at + k] = Math.min(a, b) * points + Math.max(a, b);
    }
    at += count;
  }
  return { triangles, edges: uniqueEdges(edgeKeys, points), ...fansOf(triangles, points) };
}

/** Edges from keys `low · points + high`, each once and in ascending order. */
export function uniqueEdges(keys: Float64Array, points: number): Uint32Array {
  keys.sort();
  const edges = new Uint32Array(2 * keys.length);
  let count = 0;
  for (let k = 0; k < keys.length; k++) {
    if (k > 0 && keys[k] === keys[k - 1]) continue;
    const low = Math.floor(keys[k] / points);
    edges[count++] = low;
    edges[count++] = keys[k] - low * points;
  }
  return edges.slice(0, count);
}

function fansOf(triangles: Uint32Array, points: number): Pick<Surface, 'fanStarts' | 'fans'> {
  const { starts: fanStarts, items } = byVertex(triangles, 1, points);
  const fans = new Uint32Array(2 * triangles.length);
  items.forEach((corner, k) => {
    const first = corner - (corner % 3);
    fans[2 * k] = triangles[first + ((corner + 1) % 3)];
    fans[2 * k + 1] = triangles[first + ((corner + 2) % 3)];
  });
  return { fanStarts, fans };
}
