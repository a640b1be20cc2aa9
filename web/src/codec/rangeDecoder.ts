/** Adaptive binary models and the range decoder (Martin 1979) that reads digits by them; docs/FORMAT.md, "Numbers". */

import { CodedDataError } from './error';

/** Words that a decoder may read past the end of what an encoder wrote. */
const MAX_PAST = 2;
/** Rates at which the two estimates of a model change at least: 1/16 and 1/128. */
const FAST_RATE = 16;
const SLOW_RATE = 128;

/** Some binary models: each estimates the probability that a digit is 0 from the digits it met. */
export class BinaryModels {
  /** Two estimates in units of 2⁻¹⁶, and the number of digits met: three numbers for each model. */
  readonly state: Uint16Array;

  constructor(count: number) {
    this.state = new Uint16Array(3 * count);
    for (let k = 0; k < this.state.length; k += 3) {
      this.state[k] = 1 << 15;
      this.state[k + 1] = 1 << 15;
    }
  }
}

/**
 * Reads binary digits from little-endian words of 32 bits.
 *
 * Only the distance of the point from the lower end of the interval and the interval's range are kept, both as two halves of 32 bits: products of a half and
 * a probability of 16 bits are exact in double precision.
 */
export class RangeDecoder {
  private readonly words: DataView;
  private next = 0;
  private past = 0;
  /** Range, high and low half; distance of the point, high and low half. */
  private readonly interval = new Uint32Array(4);

  constructor(bytes: Uint8Array) {
    if (bytes.length % 4 !== 0) throw new CodedDataError('coded numbers are cut');
    this.words = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    this.interval[0] = 0xffffffff;
    this.interval[1] = 0xffffffff;
    this.interval[2] = this.word();
    this.interval[3] = this.word();
  }

  /** Reads a digit by a model, which adapts to it. */
  bit(models: BinaryModels, index: number): 0 | 1 {
    const state = models.state;
    const at = 3 * index;
    const fast = state[at];
    const slow = state[at + 1];
    const met = state[at + 2];
    let zero = (fast + slow) >> 1;
    if (zero < 48) {
      zero = 48;
    } else if (zero > 65488) {
      zero = 65488;
    }
    const digit = this.digit(zero);
    const fastRate = met + 2 < FAST_RATE ? met + 2 : FAST_RATE;
    const slowRate = met + 2 < SLOW_RATE ? met + 2 : SLOW_RATE;
    if (digit === 1) {
      state[at] = fast - ((fast / fastRate) | 0);
      state[at + 1] = slow - ((slow / slowRate) | 0);
    } else {
      state[at] = fast + (((65535 - fast) / fastRate) | 0);
      state[at + 1] = slow + (((65535 - slow) / slowRate) | 0);
    }
    if (met < SLOW_RATE) state[at + 2] = met + 1;
    return digit;
  }

  /** Reads a number of so many binary digits, all equally likely, the highest first. */
  bits(count: number): number {
    let number = 0;
    for (let k = 0; k < count; k++) number = ((number << 1) | this.digit(1 << 15)) >>> 0;
    return number;
  }

  /** Reads a digit that is 0 with the probability `zero` · 2⁻¹⁶. */
  private digit(zero: number): 0 | 1 {
    const interval = this.interval;
    let rangeHigh = interval[0];
    let rangeLow = interval[1];
    let high = interval[2];
    let low = interval[3];
    // (range >> 16) · zero.
    const carried = ((Math.imul(rangeHigh, zero) << 16) >>> 0) + (Math.imul(rangeLow >>> 16, zero) >>> 0);
    const splitHigh = ((rangeHigh * zero) / 65536 + (carried > 0xffffffff ? 1 : 0)) >>> 0;
    const splitLow = carried >>> 0;
    let digit: 0 | 1;
    if (high < splitHigh || (high === splitHigh && low < splitLow)) {
      digit = 0;
      rangeHigh = splitHigh;
      rangeLow = splitLow;
    } else {
      digit = 1;
      // What is left of (range >> 16) << 16.
      const wholeLow = (rangeLow & 0xffff0000) >>> 0;
      rangeHigh = (rangeHigh - splitHigh - (wholeLow < splitLow ? 1 : 0)) >>> 0;
      rangeLow = (wholeLow - splitLow) >>> 0;
      high = (high - splitHigh - (low < splitLow ? 1 : 0)) >>> 0;
      low = (low - splitLow) >>> 0;
      if (high > rangeHigh || (high === rangeHigh && low >= rangeLow))
        throw new CodedDataError('coded numbers are damaged');
    }
    if (rangeHigh === 0) {
      rangeHigh = rangeLow;
      rangeLow = 0;
      high = low;
      low = this.word();
    }
    interval[0] = rangeHigh;
    interval[1] = rangeLow;
    interval[2] = high;
    interval[3] = low;
    return digit;
  }

  private word(): number {
    if (this.next < this.words.byteLength) {
      this.next += 4;
      return this.words.getUint32(this.next - 4, true);
    }
    this.past++;
    if (this.past > MAX_PAST) throw new CodedDataError('coded numbers are damaged');
    return 0;
  }
}
