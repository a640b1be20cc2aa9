/** How the basis of cages is computed, as a group says; docs/FORMAT.md, "Basis". `crates/codec/src/gram_rounding.rs` is the reference. */

import { CodedDataError } from './error';

/** The basis that a group of cages is in. */
export interface BasisRecord {
  readonly rotated: boolean;
  /** How the Gram matrix is rounded; `null` in files of programs up to 0.2, which did not. */
  readonly rounding: GramRounding | null;
  /** The same for equal records alone. */
  readonly key: string;
}

/** Steps of two to the power of `exponent`; `between` has the entries of the lower triangle between two whole numbers, and whether the one to take is odd. */
export interface GramRounding {
  readonly exponent: number;
  readonly between: ReadonlyMap<number, boolean>;
}

/** Reads a record from the front of a group's bytes; `length` is how many it takes. */
export function readBasisRecord(bytes: Uint8Array): { record: BasisRecord; length: number } {
  const kind = bytes.length > 0 ? bytes[0] : 4;
  if (kind > 3) throw new CodedDataError('a group of cages has an unknown basis');
  const reader = new NumberReader(bytes, 1);
  const rounding = kind >= 2 ? readRounding(reader) : null;
  const key = bytes.subarray(0, reader.at).join(',');
  return { record: { rotated: kind % 2 === 1, rounding, key }, length: reader.at };
}

function readRounding(reader: NumberReader): GramRounding {
  const exponent = ((reader.byte() | (reader.byte() << 8)) << 16) >> 16;
  const count = reader.number();
  if (Math.abs(exponent) > 1000 || count > reader.left) reader.fail();
  const between = new Map<number, boolean>();
  let next = 0;
  for (let k = 0; k < count; k++) {
    const number = reader.number();
    const place = next + Math.floor(number / 2);
    between.set(place, number % 2 === 1);
    next = place + 1;
  }
  return { exponent, between };
}

/** Rounds the lower triangle of a matrix, rows × rows, to whole steps. */
export function roundGram(matrix: Float64Array, rows: number, rounding: GramRounding): void {
  const step = 2 ** rounding.exponent;
  let found = 0;
  for (let i = 0, place = 0; i < rows; i++) {
    for (let j = 0; j <= i; j++, place++) {
      const steps = matrix[i * rows + j] / step;
      const isOdd = rounding.between.get(place);
      let whole = Math.round(steps);
      if (isOdd !== undefined) {
        whole = isOdd ? 2 * Math.round((steps - 1) / 2) + 1 : 2 * Math.round(steps / 2);
        found++;
      }
      matrix[i * rows + j] = whole * step;
    }
  }
  if (found !== rounding.between.size) throw new CodedDataError('the rounding of a basis is damaged');
}

/** Whole numbers of seven bits a byte. */
class NumberReader {
  constructor(
    private readonly bytes: Uint8Array,
    public at: number,
  ) {}

  get left(): number {
    return this.bytes.length - this.at;
  }

  fail(): never {
    throw new CodedDataError('the rounding of a basis is damaged');
  }

  byte(): number {
    if (this.left <= 0) this.fail();
    return this.bytes[this.at++];
  }

  number(): number {
    for (let number = 0, factor = 1; factor < 2 ** 35; factor *= 128) {
      const byte = this.byte();
      number += (byte & 127) * factor;
      if (byte < 128) return number;
    }
    return this.fail();
  }
}
