/** Trajectories that the frames of a group share, E in `M ≈ E·A`; docs/FORMAT.md, "Trajectories". */

import { IntegerModels, MAX_CONTEXT_SIZE, SIZE_CLASSES, sizeClass } from './integers';
import { multiply } from './dense';
import type { RangeDecoder } from './rangeDecoder';

/** Largest number of binary digits of an entry. */
const MAX_DIGITS = 26;

/** Reads E, frames × components, row by row. */
export function decodeTrajectories(decoder: RangeDecoder, frames: number, components: number): Float64Array {
  const lengths = new IntegerModels(1);
  const models = new IntegerModels(SIZE_CLASSES);
  /** Sizes of the component before. */
  const above = new Uint32Array(frames);
  const waves = new Float64Array(frames * components);
  let digits = 0;
  for (let component = 0; component < components; component++) {
    digits = Math.max(0, Math.min(MAX_DIGITS, digits + lengths.signed(decoder, 0)));
    const unit = 2 ** -digits;
    let last = 0;
    let lastButOne = 0;
    for (let t = 0; t < frames; t++) {
      const value = models.signed(decoder, sizeClass(8 * last + 4 * lastButOne + 4 * above[t]));
      waves[t * components + component] = value * unit;
      lastButOne = last;
      last = Math.min(Math.abs(value), MAX_CONTEXT_SIZE);
      above[t] = last;
    }
  }
  return multiply(inverseCosines(frames), waves, frames, frames, components);
}

/** The inverse of the orthonormal cosine transform (DCT-II) of n values, row by row. */
function inverseCosines(n: number): Float64Array {
  const matrix = new Float64Array(n * n);
  for (let k = 0; k < n; k++) {
    const scale = Math.sqrt((k === 0 ? 1 : 2) / n);
    for (let t = 0; t < n; t++) matrix[t * n + k] = scale * Math.cos((Math.PI * (t + 0.5) * k) / n);
  }
  return matrix;
}
