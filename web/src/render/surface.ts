import type { StaticPart } from '../capture';
import { type Fans, fansOf, type Polygons, triangulated } from '../codec/polygons';

export interface Surface extends Fans {
  /** Three points of each triangle; polygons are cut into fans. */
  readonly triangles: Uint32Array;
  /** Two points of each edge of the polygons, each edge once. */
  readonly edges: Uint32Array;
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
  return {
    triangles,
    edges: edgesOf({ counts: cornerCounts, corners }, points),
    ...fansOf(triangles, triangles, points),
  };
}

/** Two points of each edge of polygons, each edge once and in ascending order. */
export function edgesOf({ counts, corners }: Polygons, points: number): Uint32Array {
  const keys = new Float64Array(corners.length);
  let at = 0;
  for (const count of counts) {
    for (let k = 0; k < count; k++) {
      const [a, b] = [corners[at + k], corners[at + ((k + 1) % count)]];
      keys[at + k] = Math.min(a, b) * points + Math.max(a, b);
    }
    at += count;
  }
  const unique = keys.sort().filter((key, k) => k === 0 || key !== keys[k - 1]);
  return Uint32Array.from({ length: 2 * unique.length }, (_, k) => {
    const key = unique[k >> 1];
    return k % 2 === 0 ? Math.floor(key / points) : key % points;
  });
}
