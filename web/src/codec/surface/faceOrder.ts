/** The order of faces, and the corner that each begins with, as the source has them; docs/FORMAT.md, "surf". */

import { CodedDataError } from '../error';
import { IntegerModels } from '../integers';
import { adjacency, type ByVertex, type Polygons } from '../polygons';
import { RangeDecoder } from '../rangeDecoder';
import { decodeOrder, MAX_FAR_POINTS } from '../vertexOrder';

/** Faces of more corners share a context. */
const ARITIES = 8;

/** The faces in the order of the source, each beginning with its corner there. */
export function decodeFaceOrder(bytes: Uint8Array, coded: Polygons, points: number): Polygons {
  if (bytes.length === 0) return coded;
  const decoder = new RangeDecoder(bytes);
  const isFar = decoder.bits(1) === 1;
  if (isFar && coded.counts.length > MAX_FAR_POINTS)
    throw new CodedDataError('the order of so many faces cannot have been written');
  return turned(decoder, coded, decodeOrder(decoder, facesBeside(coded, points), isFar));
}

/** Faces that share an edge, where no face between them in the list has it. */
function facesBeside({ counts, corners }: Polygons, points: number): ByVertex {
  const last = new Map<number, number>();
  const pairs: number[] = [];
  let first = 0;
  for (let face = 0; face < counts.length; face++) {
    const end = first + counts[face];
    for (let k = first; k < end; k++) {
      const edge = edgeKey(corners[k], corners[k + 1 < end ? k + 1 : first], points);
      const other = last.get(edge);
      if (other !== undefined) pairs.push(other, face);
      last.set(edge, face);
    }
    first = end;
  }
  const edges = { counts: new Uint32Array(pairs.length / 2).fill(2), corners: Uint32Array.from(pairs) };
  return adjacency(edges, counts.length);
}

/** A number for an edge in either direction. */
export function edgeKey(a: number, b: number, points: number): number {
  return a < b ? a * points + b : b * points + a;
}

/** Reads where each face begins, counted from its smallest point. */
function turned(decoder: RangeDecoder, coded: Polygons, order: Uint32Array): Polygons {
  const starts = new Uint32Array(coded.counts.length + 1);
  coded.counts.forEach((count, face) => (starts[face + 1] = starts[face] + count));
  const models = new IntegerModels(ARITIES * ARITIES);
  const corners = new Uint32Array(coded.corners.length);
  let [at, before] = [0, 0];
  for (const face of order) {
    const [start, count] = [starts[face], coded.counts[face]];
    let smallest = 0;
    for (let k = 1; k < count; k++) {
      if (coded.corners[start + k] < coded.corners[start + smallest]) smallest = k;
    }
    const context = ARITIES * Math.min(count, ARITIES - 1) + before;
    const turn = models.natural(decoder, context) % Math.max(count, 1);
    before = Math.min(turn, ARITIES - 1);
    for (let k = 0; k < count; k++) corners[at++] = coded.corners[start + ((smallest + turn + k) % count)];
  }
  return { counts: Uint32Array.from(order, (face) => coded.counts[face]), corners };
}
