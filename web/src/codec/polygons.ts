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

/** The items of a list that name each vertex: those of vertex v are `items[starts[v] … starts[v + 1])`, ascending. */
export interface ByVertex {
  readonly starts: Uint32Array;
  readonly items: Uint32Array;
}

/** Inverts a list of items of `size` vertices each. */
export function byVertex(vertices: ArrayLike<number>, size: number, points: number): ByVertex {
  const starts = new Uint32Array(points + 1);
  for (let k = 0; k < vertices.length; k++) starts[vertices[k] + 1]++;
  for (let v = 0; v < points; v++) starts[v + 1] += starts[v];
  const places = starts.slice();
  const items = new Uint32Array(vertices.length);
  for (let k = 0; k < vertices.length; k++) items[places[vertices[k]]++] = Math.floor(k / size);
  return { starts, items };
}

/** The triangles around each of some owners: those of owner k are `fans[2·fanStarts[k] … 2·fanStarts[k + 1])`, the other two corners of each, in order. */
export interface Fans {
  readonly fanStarts: Uint32Array;
  readonly fans: Uint32Array;
}

/** @param owners whose each corner of the triangles is, one of `count` */
export function fansOf(triangles: Uint32Array, owners: Uint32Array, count: number): Fans {
  const { starts: fanStarts, items } = byVertex(owners, 1, count);
  const fans = new Uint32Array(2 * triangles.length);
  items.forEach((corner, k) => {
    const first = corner - (corner % 3);
    fans[2 * k] = triangles[first + ((corner + 1) % 3)];
    fans[2 * k + 1] = triangles[first + ((corner + 2) % 3)];
  });
  return { fanStarts, fans };
}

/** The vertices that edges of these faces join each vertex to, each once and in no certain order. */
export function adjacency(faces: Polygons, points: number): ByVertex {
  const starts = new Uint32Array(points + 1);
  forEachEdge(faces, (a, b) => {
    starts[a + 1]++;
    starts[b + 1]++;
  });
  for (let v = 0; v < points; v++) starts[v + 1] += starts[v];
  const ends = starts.slice();
  const items = new Uint32Array(starts[points]);
  forEachEdge(faces, (a, b) => {
    items[ends[a]++] = b;
    items[ends[b]++] = a;
  });
  /** The last vertex, counted from 1, that each was found beside. */
  const beside = new Uint32Array(points);
  let length = 0;
  for (let v = 0; v < points; v++) {
    const end = starts[v + 1];
    let k = starts[v];
    starts[v] = length;
    for (; k < end; k++) {
      const w = items[k];
      if (beside[w] !== v + 1) {
        beside[w] = v + 1;
        items[length++] = w;
      }
    }
  }
  starts[points] = length;
  return { starts, items: items.slice(0, length) };
}

/** Calls back for the two ends of each edge of each face, those that are the same vertex aside. */
function forEachEdge({ counts, corners }: Polygons, call: (a: number, b: number) => void): void {
  let first = 0;
  for (const count of counts) {
    let a = corners[first + count - 1];
    for (let k = first; k < first + count; k++) {
      const b = corners[k];
      if (a !== b) call(a, b);
      a = b;
    }
    first += count;
  }
}
