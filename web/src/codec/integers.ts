/** Whole numbers by binary models of their digits; docs/FORMAT.md, "Numbers". */

import { BinaryModels, type RangeDecoder } from './rangeDecoder';

/** Sizes from 1 to this are coded in unary. */
const UNARY = 14;
/** Models of one context: whether the number is 0, its sign, and the unary digits of its size. */
const PER_CONTEXT = 2 + UNARY;
/** Largest size of a signed number. */
export const MAX_SIZE = 2 ** 28;
/** Sizes around a number count up to this for its context. */
export const MAX_CONTEXT_SIZE = 2 ** 20;
/** Sizes of residuals are kept up to this. */
export const MAX_RESIDUAL_SIZE = 2 ** 16;
export const SIZE_CLASSES = 16;

const EDGES = [1, 3, 5, 8, 12, 17, 24, 34, 48, 70, 100, 150, 230, 400, 900];
const LAST_EDGE = EDGES[EDGES.length - 1];
const CLASSES = Uint8Array.from({ length: LAST_EDGE }, (_, size) => EDGES.filter((edge) => edge <= size).length);

/** Class of a size around a number, in sixteenths: 0 to 15. */
export function sizeClass(sixteenths: number): number {
  return sixteenths < LAST_EDGE ? CLASSES[sixteenths] : SIZE_CLASSES - 1;
}

/** Models of whole numbers in some contexts, which share the models of large sizes. */
export class IntegerModels {
  private readonly contexts: BinaryModels;
  private readonly exponent = new BinaryModels(32);
  private readonly leading = new BinaryModels(32);

  constructor(contexts: number) {
    this.contexts = new BinaryModels(PER_CONTEXT * contexts);
  }

  /** Reads a number between −2²⁸ and 2²⁸. */
  signed(decoder: RangeDecoder, context: number): number {
    const models = this.contexts;
    const base = PER_CONTEXT * context;
    if (decoder.bit(models, base) === 0) return 0;
    const negative = decoder.bit(models, base + 1) === 1;
    let size = 1;
    while (size <= UNARY && decoder.bit(models, base + 1 + size) === 1) size++;
    if (size > UNARY) size = Math.min(UNARY + this.largeSize(decoder), MAX_SIZE);
    return negative ? -size : size;
  }

  /** Reads a number that is not negative, up to 2³² − 1. */
  natural(decoder: RangeDecoder, context: number): number {
    const base = PER_CONTEXT * context + 2;
    for (let size = 0; size < UNARY; size++) {
      if (decoder.bit(this.contexts, base + size) === 0) return size;
    }
    const count = this.digits(decoder, 31);
    const number = ((1 << count) >>> 0) + decoder.bits(count);
    return Math.min(number - 1 + UNARY, 0xffffffff);
  }

  /** What a size is above {@link UNARY}. */
  private largeSize(decoder: RangeDecoder): number {
    const count = this.digits(decoder, 28);
    if (count === 0) return 1;
    const leading = 2 | decoder.bit(this.leading, count);
    return leading * 2 ** (count - 1) + decoder.bits(count - 1);
  }

  private digits(decoder: RangeDecoder, most: number): number {
    let count = 0;
    while (count < most && decoder.bit(this.exponent, count) === 1) count++;
    return count;
  }
}
