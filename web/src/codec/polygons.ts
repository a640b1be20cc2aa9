/** Faces with any number of corners. */
export interface Polygons {
  /** Number of corners of each face. */
  readonly counts: Uint32Array;
  /** Point indices of all corners, face by face. */
  readonly corners: Uint32Array;
}

export const NO_POLYGONS: Polygons = { counts: new Uint32Array(0), corners: new Uint32Array(0) };

export function polygonsOf(triangles: Uint32Array): Polygons {
  return { counts: new Uint32Array(triangles.length / 3).fill(3), corners: triangles };
}

/** Fans of triangles around each face's first corner, three indices each. */
export function triangulated({ counts, corners }: Polygons): Uint32Array {
  let total = 0;
  for (let face = 0; face < counts.length; face++) total += Math.max(counts[face] - 2, 0);
  const triangles = new Uint32Array(3 * total);
  let out = 0;
  let first = 0;
  for (let face = 0; face < counts.length; face++) {
    for (let k = 2; k < counts[face]; k++) {
      triangles[out++] = corners[first];
      triangles[out++] = corners[first + k - 1];
      triangles[out++] = corners[first + k];
    }
    first += counts[face];
  }
  return triangles;
}
