/** The mesh that is drawn with materials: points are split at seams and hard edges, and triangles are sorted by material and part. */

import type { PartSurface } from './decodeSurface';
import { type SplitNormals, SplitVertices } from './splitVertices';

/** Triangles that are drawn together. */
export interface TriangleRange {
  readonly part: number;
  /** 0 for none, else one more than the place of the material. */
  readonly material: number;
  /** Which tile of a picture in tiles. */
  readonly tile: number;
  /** Where its corners begin in the list of triangles, and how many they are. */
  readonly start: number;
  readonly count: number;
}

export interface SplitMesh {
  /** Point of each vertex. */
  readonly points: Uint32Array;
  /** u and v of each vertex, v upwards. */
  readonly uvs: Float32Array;
  /** Normal of each vertex: its place in `split`, or without that its point. */
  readonly normals: Uint32Array;
  readonly split: SplitNormals | null;
  /** Three vertices of each triangle. */
  readonly triangles: Uint32Array;
  /** Ascending by material, tile and part. */
  readonly ranges: readonly TriangleRange[];
}

/** Number of the first tile. */
export const FIRST_TILE = 1001;
const NO_UV = [0, 0] as const;

/** @param isTiled whether each material has pictures in tiles */
export function splitMesh(parts: readonly PartSurface[], points: number, isTiled: readonly boolean[]): SplitMesh {
  const vertices = new SplitVertices(points);
  const lists = new Map<string, Omit<TriangleRange, 'start' | 'count'> & { corners: number[] }>();
  parts.forEach(({ faces, uvs, normals, tilts, materials }, part) => {
    const uvOf = (corner: number): readonly [number, number] => {
      if (uvs === null) return NO_UV;
      const at = 2 * uvs.numbers[corner];
      return [uvs.values[at], uvs.values[at + 1]];
    };
    let first = 0;
    faces.counts.forEach((count, face) => {
      const material = materials?.[face] ?? 0;
      const tile = material > 0 && isTiled[material - 1] ? tileOf(first, count, uvOf) : FIRST_TILE;
      const key = `${material} ${tile} ${part}`;
      const list = lists.get(key) ?? { part, material, tile, corners: [] };
      lists.set(key, list);
      let [start, before] = [0, 0];
      for (let k = 0; k < count; k++) {
        const at = first + k;
        const number = normals?.[at] ?? 0;
        const next = faces.corners[k + 1 < count ? at + 1 : first];
        const tilt = { next, along: tilts?.[2 * number] ?? 0, across: tilts?.[2 * number + 1] ?? 0 };
        const vertex = vertices.of(faces.corners[at], uvs?.numbers[at] ?? 0, number, uvOf(at), tilt);
        if (k === 0) start = vertex;
        else if (k > 1) list.corners.push(start, before, vertex);
        before = vertex;
      }
      first += count;
    });
  });
  const sorted = [...lists.values()].sort((a, b) => a.material - b.material || a.tile - b.tile || a.part - b.part);
  const triangles = new Uint32Array(sorted.reduce((sum, { corners }) => sum + corners.length, 0));
  const ranges: TriangleRange[] = [];
  let start = 0;
  for (const { part, material, tile, corners } of sorted) {
    triangles.set(corners, start);
    ranges.push({ part, material, tile, start, count: corners.length });
    start += corners.length;
  }
  return { ...vertices.finish(triangles), triangles, ranges };
}

/** The tile that the middle of a face lies in: ten are beside each other, and a hundred rows above each other at the most. */
function tileOf(first: number, count: number, uvOf: (corner: number) => readonly [number, number]): number {
  let [u, v] = [0, 0];
  for (let k = first; k < first + count; k++) {
    u += uvOf(k)[0] / count;
    v += uvOf(k)[1] / count;
  }
  const [column, row] = [Math.floor(u), Math.floor(v)];
  return column >= 0 && column < 10 && row >= 0 && row < 100 ? FIRST_TILE + column + 10 * row : FIRST_TILE;
}
