import type { ByVertex } from './byVertex';
import type { Polygons } from './polygons';

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
