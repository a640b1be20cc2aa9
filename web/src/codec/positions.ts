/** Positions of a mesh at rest on a grid, predicted by parallelograms; docs/FORMAT.md, "Faces and positions of meshes". */

import { CodedDataError } from './error';
import { IntegerModels, MOST, SIZE_CLASSES, sizeClass } from './integers';
import { parallelogramPredictions } from './parallelograms';
import type { Polygons } from './polygons';
import { RangeDecoder } from './rangeDecoder';

/** Origin (three f64) and step (f64) of the grid. */
const HEAD_BYTES = 32;

/**
 * Decodes the positions of so many points, x y z each, that the encoder wrote for the same faces in the same order. Damaged bytes may give positions that are
 * not finite.
 *
 * @throws {CodedDataError} for bytes that the encoder did not write.
 */
export function decodePositions(bytes: Uint8Array, faces: Polygons, points: number): Float64Array {
  if (bytes.length < HEAD_BYTES) {
    throw new CodedDataError('positions are cut');
  }
  const head = new DataView(bytes.buffer, bytes.byteOffset, HEAD_BYTES);
  const steps = decodeSteps(new RangeDecoder(bytes.subarray(HEAD_BYTES)), faces, points);
  const step = head.getFloat64(24, true);
  const positions = new Float64Array(3 * points);
  for (let k = 0; k < 3; k++) {
    const origin = head.getFloat64(8 * k, true);
    for (let at = k; at < positions.length; at += 3) {
      positions[at] = Math.fround(origin + steps[at] * step);
    }
  }
  return positions;
}

function decodeSteps(decoder: RangeDecoder, faces: Polygons, points: number): Int32Array {
  const { order, starts, triples, near } = parallelogramPredictions(faces, points);
  const found = new Int32Array(3 * points);
  const models = new IntegerModels(3 * SIZE_CLASSES);
  let around = 0;
  for (let place = 0; place < points; place++) {
    const vertex = order[place];
    const count = starts[place + 1] - starts[place];
    let size = 0;
    for (let k = 0; k < 3; k++) {
      let expected = 0;
      if (count > 0) {
        let sum = 0;
        for (let t = 3 * starts[place]; t < 3 * starts[place + 1]; t += 3) {
          sum += found[3 * triples[t] + k] + found[3 * triples[t + 1] + k] - found[3 * triples[t + 2] + k];
        }
        expected = Math.floor(sum / count);
      } else if (near[place] !== vertex) {
        expected = found[3 * near[place] + k];
      }
      expected = Math.max(-MOST, Math.min(MOST, expected));
      const context = SIZE_CLASSES * Math.min(count, 2) + sizeClass(around + 6 * size);
      const value = models.signed(decoder, context);
      found[3 * vertex + k] = value + expected;
      size += Math.min(Math.abs(value), 1 << 16);
    }
    around = (around + Math.floor((8 * size) / 3)) >> 1;
  }
  return found;
}
