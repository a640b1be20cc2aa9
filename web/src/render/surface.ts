import type { StaticPart } from '../capture';

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
  let triangleCount = 0;
  for (let f = 0; f < cornerCounts.length; f++) triangleCount += Math.max(0, cornerCounts[f] - 2);
  const triangles = new Uint32Array(3 * triangleCount);
  const edgeKeys = new Float64Array(corners.length);
  let [at, triangle, edge] = [0, 0, 0];
  for (let f = 0; f < cornerCounts.length; f++) {
    const count = cornerCounts[f];
    for (let k = 0; k < count; k++) {
      const [a, b] = [corners[at + k], corners[at + ((k + 1) % count)]];
      edgeKeys[edge++] = Math.min(a, b) * points + Math.max(a, b);
      if (k < 2) continue;
      triangles[triangle++] = corners[at];
      triangles[triangle++] = corners[at + k - 1];
      triangles[triangle++] = corners[at + k];
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
  const fanStarts = new Uint32Array(points + 1);
  for (const point of triangles) fanStarts[point + 1]++;
  for (let p = 0; p < points; p++) fanStarts[p + 1] += fanStarts[p];
  const next = fanStarts.slice();
  const fans = new Uint32Array(2 * triangles.length);
  for (let corner = 0; corner < triangles.length; corner++) {
    const first = corner - (corner % 3);
    const slot = 2 * next[triangles[corner]]++;
    fans[slot] = triangles[first + ((corner + 1) % 3)];
    fans[slot + 1] = triangles[first + ((corner + 2) % 3)];
  }
  return { fanStarts, fans };
}
