import { describe, expect, it } from 'vitest';
import { CodedDataError } from './error';
import { IntegerModels, sizeClass } from './integers';
import { BinaryModels, RangeDecoder } from './rangeDecoder';

/** The decoder as docs/FORMAT.md has it, in whole numbers of any size. */
class Reference {
  private lower = 0n;
  private range = 2n ** 64n - 1n;
  private point: bigint;
  private next = 2;
  private readonly words: Uint32Array;
  private readonly models = new Map<number, { fast: number; slow: number; met: number }>();

  constructor(bytes: Uint8Array) {
    this.words = new Uint32Array(bytes.slice().buffer);
    this.point = (BigInt(this.words[0]) << 32n) | BigInt(this.words[1]);
  }

  bit(index: number): number {
    const model = this.models.get(index) ?? { fast: 2 ** 15, slow: 2 ** 15, met: 0 };
    this.models.set(index, model);
    const p = Math.min(65_488, Math.max(48, Math.floor((model.fast + model.slow) / 2)));
    const digit = this.digit(BigInt(p));
    const toward = (x: number, rate: number) =>
      digit === 1 ? x - Math.floor(x / rate) : x + Math.floor((65_535 - x) / rate);
    model.fast = toward(model.fast, Math.min(model.met + 2, 16));
    model.slow = toward(model.slow, Math.min(model.met + 2, 128));
    model.met = Math.min(model.met + 1, 128);
    return digit;
  }

  private digit(p: bigint): number {
    const scale = this.range >> 16n;
    const quantile = BigInt.asUintN(64, this.point - this.lower) / scale;
    if (quantile >= 2n ** 16n) throw new CodedDataError('damaged');
    const digit = quantile < p ? 0 : 1;
    this.lower = BigInt.asUintN(64, this.lower + (digit === 1 ? scale * p : 0n));
    this.range = digit === 1 ? scale * (2n ** 16n - p) : scale * p;
    if (this.range < 2n ** 32n) {
      this.lower = BigInt.asUintN(64, this.lower << 32n);
      this.range <<= 32n;
      const word = this.next < this.words.length ? this.words[this.next] : 0;
      this.point = BigInt.asUintN(64, this.point << 32n) | BigInt(word);
      this.next++;
    }
    return digit;
  }
}

/** Bytes of a generator of Lehmer's; `kind` makes some streams of likely digits. */
function bytesOf(seed: number, length: number): Uint8Array {
  let state = seed;
  return Uint8Array.from({ length }, (_, k) => {
    state = (state * 48_271) % 2_147_483_647;
    return seed % 3 === 0 && k > 8 ? (state >> 8) & (state >> 16) & 0xff : (state >> 8) & 0xff;
  });
}

describe('RangeDecoder', () => {
  it('reads the digits that arithmetic of 64 bits gives', () => {
    let digits = 0;
    for (let seed = 1; seed <= 60; seed++) {
      const bytes = bytesOf(seed, 400);
      const decoder = new RangeDecoder(bytes);
      const reference = new Reference(bytes);
      const models = new BinaryModels(5);
      // So few digits do not reach the end of the words.
      for (let k = 0; k < 2_500; k++) {
        const model = (k * k) % 5;
        let expected: number | null;
        try {
          expected = reference.bit(model);
        } catch {
          expected = null;
        }
        if (expected === null) {
          expect(() => decoder.bit(models, model)).toThrow(CodedDataError);
          break;
        }
        if (decoder.bit(models, model) !== expected) expect.fail(`seed ${seed}, digit ${k}`);
        digits++;
      }
    }
    expect(digits).toBeGreaterThan(100_000);
  });

  it('notices that more is read than was written', () => {
    const decoder = new RangeDecoder(bytesOf(1, 40));
    expect(() => Array.from({ length: 50 }, () => decoder.bits(20))).toThrow(/damaged/);
  });

  it('refuses bytes that are no words', () => {
    expect(() => new RangeDecoder(new Uint8Array(3))).toThrow(/cut/);
  });
});

describe('IntegerModels', () => {
  it('gives numbers within their range for any bytes', () => {
    for (let seed = 1; seed < 100; seed++) {
      const decoder = new RangeDecoder(bytesOf(seed, 4_000));
      const models = new IntegerModels(1);
      for (let k = 0; k < 50; k++) {
        expect(Math.abs(models.signed(decoder, 0))).toBeLessThanOrEqual(2 ** 28);
        const natural = models.natural(decoder, 0);
        expect(Number.isInteger(natural) && natural >= 0 && natural < 2 ** 32).toBe(true);
      }
    }
  });

  it('classes sizes by how many edges are not above them', () => {
    expect([0, 1, 2, 3, 899, 900, 1e9].map(sizeClass)).toEqual([0, 1, 1, 2, 14, 15, 15]);
  });
});
