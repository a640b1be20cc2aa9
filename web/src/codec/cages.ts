/** Cages of a group of frames; docs/FORMAT.md, "Cages". `crates/codec/src/cage.rs` is the reference. */

import type { CageBasis } from './basis';
import { multiply } from './dense';
import { CodedDataError } from './error';
import { type BasisRecord, readBasisRecord } from './gramRounding';
import { IntegerModels, MAX_CONTEXT_SIZE, SIZE_CLASSES, sizeClass } from './integers';
import { RangeDecoder } from './rangeDecoder';
import { decodeTrajectories } from './trajectories';

export const MAX_FRAMES = 1024;
export const MAX_ROWS = 4096;
/** After the basis, the step (f64) and the number of components (u16). */
const HEAD_BYTES = 10;

/** What a group of cages holds: `E·A` in whole steps of a basis. */
export interface CageNumbers {
  readonly frames: number;
  readonly basis: BasisRecord;
  readonly step: number;
  readonly components: number;
  /** E, frames × components. */
  readonly trajectories: Float64Array;
  /** A, components × 3·rows. */
  readonly numbers: Int32Array;
}

/** Reads the numbers of a group of so many frames. */
export function decodeCageNumbers(bytes: Uint8Array, frames: number, rows: number): CageNumbers {
  const { record: basis, length } = readBasisRecord(bytes);
  if (bytes.length < length + HEAD_BYTES) throw new CodedDataError('a group of cages is cut');
  const head = new DataView(bytes.buffer, bytes.byteOffset + length, HEAD_BYTES);
  const step = head.getFloat64(0, true);
  const components = head.getUint16(8, true);
  const possible = Number.isFinite(step) && step > 0 && components <= Math.min(frames, 3 * rows);
  if (frames > MAX_FRAMES || rows > MAX_ROWS || !possible)
    throw new CodedDataError('a group of cages has impossible counts');
  const decoder = new RangeDecoder(bytes.subarray(length + HEAD_BYTES));
  const trajectories = decodeTrajectories(decoder, frames, components);
  const numbers = decodeNumbers(decoder, components, 3 * rows);
  return { frames, basis, step, components, trajectories, numbers };
}

/** The rows of all frames of a group, frames × rows × 3. */
export function cagesOf(group: CageNumbers, basis: CageBasis, rest: Float64Array): Float32Array {
  const { frames, components, trajectories, numbers, step } = group;
  const rows = rest.length / 3;
  // Coefficients row by row, three columns for each component.
  const coefficients = new Float64Array(rows * 3 * components);
  for (let row = 0; row < rows; row++) {
    for (let k = 0; k < components; k++) {
      for (let axis = 0; axis < 3; axis++) {
        coefficients[(row * components + k) * 3 + axis] = numbers[k * 3 * rows + 3 * row + axis] * step;
      }
    }
  }
  const moved = multiply(basis.inverse(group.basis), coefficients, rows, rows, 3 * components);
  const shapes = new Float64Array(components * 3 * rows);
  for (let row = 0; row < rows; row++) {
    for (let k = 0; k < components; k++) {
      for (let axis = 0; axis < 3; axis++) {
        shapes[k * 3 * rows + 3 * row + axis] = moved[(row * components + k) * 3 + axis];
      }
    }
  }
  const differences = multiply(trajectories, shapes, frames, components, 3 * rows);
  const cages = new Float32Array(differences.length);
  for (let frame = 0; frame < frames; frame++) {
    for (let k = 0, at = frame * rest.length; k < rest.length; k++, at++) cages[at] = differences[at] + rest[k];
  }
  return cages;
}

/** Reads components × width numbers: what surrounds one in the rows, in the components and in its point says how large it will be. */
function decodeNumbers(decoder: RangeDecoder, components: number, width: number): Int32Array {
  const models = new IntegerModels(3 * SIZE_CLASSES);
  const found = new Int32Array(components * width);
  /** Sizes of this component's numbers and of the two before; six zeros in front stand for rows before the first. */
  let sizes = new Uint32Array(6 + width);
  let before = new Uint32Array(6 + width);
  let twoBefore = new Uint32Array(6 + width);
  for (let k = 0; k < components; k++) {
    for (let value = 0; value < width; value++) {
      const at = 6 + value;
      const axis = value % 3;
      let around = 8 * sizes[at - 3] + 4 * sizes[at - 6] + 8 * before[at] + 4 * twoBefore[at];
      if (axis >= 1) around += 6 * sizes[at - 1];
      if (axis === 2) around += 3 * sizes[at - 2];
      const number = models.signed(decoder, SIZE_CLASSES * axis + sizeClass(around));
      found[k * width + value] = number;
      sizes[at] = Math.min(Math.abs(number), MAX_CONTEXT_SIZE);
    }
    [sizes, before, twoBefore] = [twoBefore, sizes, before];
  }
  return found;
}
