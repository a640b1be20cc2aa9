/** The errors of frames, each to twelve binary digits, as differences to those of the frame before; docs/FORMAT.md, "Errors". */

import type { FrameErrors } from '../capture';
import { CodedDataError } from './error';
import { IntegerModels, MAX_CONTEXT_SIZE, SIZE_CLASSES, sizeClass } from './integers';
import { RangeDecoder } from './rangeDecoder';

/** Binary digits of a single-precision number that are left out. */
const LEFT_OUT = 12;
/** What the numbers that are left are below. */
const NUMBERS = 2 ** (32 - LEFT_OUT);

export function decodeFrameErrors(bytes: Uint8Array, frames: number): FrameErrors {
  const decoder = new RangeDecoder(bytes);
  const errors = { l2: new Float32Array(frames), linf: new Float32Array(frames) };
  const series = [new ErrorSeries(errors.l2), new ErrorSeries(errors.linf)];
  for (let frame = 0; frame < frames; frame++) {
    for (const each of series) each.read(decoder, frame);
  }
  return errors;
}

class ErrorSeries {
  private readonly models = new IntegerModels(SIZE_CLASSES);
  private readonly words: Uint32Array;
  private before = 0;
  private around = 0;

  constructor(private readonly errors: Float32Array<ArrayBuffer>) {
    this.words = new Uint32Array(errors.buffer);
  }

  read(decoder: RangeDecoder, frame: number): void {
    const difference = this.models.signed(decoder, sizeClass(this.around));
    this.before += difference;
    this.around = (this.around + Math.min(Math.abs(difference), MAX_CONTEXT_SIZE)) >> 1;
    this.words[frame] = this.before << LEFT_OUT;
    if (this.before < 0 || this.before >= NUMBERS || this.errors[frame] < 0)
      throw new CodedDataError('an error of a frame is negative or out of range');
  }
}
