/** One number for each face, mostly that of a face beside it; docs/FORMAT.md, "surf". */

import { IntegerModels } from '../integers';
import type { Polygons } from '../polygons';
import { BinaryModels, RangeDecoder } from '../rangeDecoder';
import { edgeKey } from './faceOrder';

export function decodeLabels(bytes: Uint8Array, { counts, corners }: Polygons, points: number): Uint32Array {
  const decoder = new RangeDecoder(bytes);
  const labels = new Uint32Array(counts.length);
  /** The label of the last face at each edge. */
  const edges = new Map<number, number>();
  const same = new BinaryModels(3);
  const numbers = new IntegerModels(1);
  let [first, before] = [0, 0];
  for (let face = 0; face < counts.length; face++) {
    const end = first + counts[face];
    const keyOf = (k: number) => edgeKey(corners[k], corners[k + 1 < end ? k + 1 : first], points);
    let found: number | undefined;
    // All neighbours alike, some not, or none.
    let context = 0;
    for (let k = first; k < end; k++) {
      const label = edges.get(keyOf(k));
      if (label === undefined) continue;
      if (found === undefined) [found, context] = [label, 1];
      else if (label !== found) context = 2;
    }
    const isSame = decoder.bit(same, context) === 1;
    before = isSame ? (found ?? before) : numbers.natural(decoder, 0);
    for (let k = first; k < end; k++) edges.set(keyOf(k), before);
    labels[face] = before;
    first = end;
  }
  return labels;
}
