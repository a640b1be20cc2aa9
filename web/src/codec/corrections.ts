/** Single vertices in single frames that are moved to where they were captured; docs/FORMAT.md, "Residual". */

import { CodedDataError } from './error';
import { IntegerModels } from './integers';
import { RangeDecoder } from './rangeDecoder';

/** The corrections of a group of frames, as in `Residual` of `capture.ts`. */
export interface Corrections {
  readonly correctionStarts: Uint32Array;
  readonly correctedPoints: Uint32Array;
  readonly correctionVectors: Float32Array;
}

/**
 * Decodes the corrections of a group, none of no bytes.
 *
 * @param step unit of the corrections.
 */
export function decodeCorrections(bytes: Uint8Array, frames: number, points: number, step: number): Corrections {
  const correctionStarts = new Uint32Array(frames + 1);
  const vertices: number[] = [];
  const vectors: number[] = [];
  if (bytes.length > 0) {
    const decoder = new RangeDecoder(bytes);
    const counts = new IntegerModels(1);
    const gaps = new IntegerModels(1);
    const steps = new IntegerModels(3);
    // Numbers of high probability take next to no bytes.
    let left = (1 << 20) + 64 * bytes.length;
    let count = 0;
    for (let frame = 0; frame < frames; frame++) {
      count = Math.max(0, count + counts.signed(decoder, 0));
      left -= count;
      if (left < 0 || count > points) {
        throw new CodedDataError('there are more corrections than there can be');
      }
      let next = 0;
      for (let k = 0; k < count; k++) {
        const vertex = next + gaps.natural(decoder, 0);
        if (vertex >= points) {
          throw new CodedDataError('a correction is of no point');
        }
        vertices.push(vertex);
        for (let axis = 0; axis < 3; axis++) {
          vectors.push(steps.signed(decoder, axis) * step);
        }
        next = vertex + 1;
      }
      correctionStarts[frame + 1] = vertices.length;
    }
  }
  return {
    correctionStarts,
    correctedPoints: Uint32Array.from(vertices),
    correctionVectors: Float32Array.from(vectors),
  };
}
