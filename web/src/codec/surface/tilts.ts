/**
 * How normals lean away from those of the faces around; docs/FORMAT.md, "surf". `crates/codec/src/surface/tilts.rs` is the reference.
 */

import { CodedDataError } from '../error';
import { IntegerModels } from '../integers';
import type { Polygons } from '../polygons';
import { BinaryModels, RangeDecoder } from '../rangeDecoder';
import type { Sharing } from './sharing';

/** Steps of half a turn. */
const STEPS = 360;
/** Normals are like the last ones that began at the same place of a face; those behind these are together. */
const PLACES = 8;

/** Two angles in radians of each normal: along the edge to the next corner of the first face that has it, and across. */
export function decodeTilts(bytes: Uint8Array, faces: Polygons, { numbers, count }: Sharing): Float32Array {
  const decoder = new RangeDecoder(bytes);
  const [tilted, models] = [new BinaryModels(2), new IntegerModels(2)];
  const last = new Int32Array(2 * PLACES);
  const angles = new Float32Array(2 * count);
  let [found, isTilted, corner] = [0, 0, 0];
  for (const arity of faces.counts) {
    for (let place = 0; place < arity; place++) {
      if (numbers[corner++] !== found) continue;
      isTilted = decoder.bit(tilted, isTilted);
      for (let k = 0; isTilted === 1 && k < 2; k++) {
        const kept = 2 * Math.min(place, PLACES - 1) + k;
        const steps = last[kept] + models.signed(decoder, k);
        if (Math.abs(steps) > STEPS) throw new CodedDataError('normals are tilted by more than half a turn');
        last[kept] = steps;
        angles[2 * found + k] = (steps * Math.PI) / STEPS;
      }
      found++;
    }
  }
  return angles;
}
