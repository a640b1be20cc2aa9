/** Entropy coding of zstd (RFC 8878, section 4): tables of finite state entropy and of Huffman codes. */

/** Bits of a stream of zstd, which is read from its end: the highest bit that is set in its last byte marks where it begins. */
export class BackwardBits {
  /** Bits that are left; below zero after more were read than there are. */
  left: number;

  constructor(private readonly bytes: Uint8Array) {
    const last = bytes.length > 0 ? bytes[bytes.length - 1] : 0;
    if (last === 0) throw new Error('its bits have no beginning');
    this.left = 8 * (bytes.length - 1) + 31 - Math.clz32(last);
  }

  /** The next bits, 24 at the most, as a number; zeros where there are no more. */
  read(count: number): number {
    const { bytes } = this;
    this.left -= count;
    const left = this.left;
    const mask = (1 << count) - 1;
    if (left < 0) return left + count > 0 ? ((bytes[0] | (bytes[1] << 8) | (bytes[2] << 16)) << -left) & mask : 0;
    const at = left >> 3;
    const word = bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16) | (bytes[at + 3] << 24);
    return (word >>> (left & 7)) & mask;
  }
}

/** Of each state of finite state entropy its symbol, the bits to read, and what is added to them to give the next state. */
export interface StateTable {
  readonly log: number;
  readonly symbols: Uint8Array;
  readonly bits: Uint8Array;
  readonly bases: Uint16Array;
}

/** Of the next bits, as many as the longest code has, the symbol that they begin with and the length of its code. */
export interface HuffmanTable {
  readonly log: number;
  readonly symbols: Uint8Array;
  readonly bits: Uint8Array;
}

const LONGEST_CODE = 11;
const MAX_WEIGHTS = 255;
const WEIGHT_LOG = 6;

/** The table in which a symbol has as many of the 2^`log` states as `counts` says; −1 stands for one at the end. */
export function stateTable(counts: readonly number[], log: number): StateTable {
  const size = 1 << log;
  const symbols = new Uint8Array(size);
  const next = counts.map((count) => Math.abs(count));
  let end = size;
  counts.forEach((count, symbol) => {
    if (count < 0) symbols[--end] = symbol;
  });
  const step = (size >> 1) + (size >> 3) + 3;
  let at = 0;
  counts.forEach((count, symbol) => {
    for (let k = 0; k < count; k++) {
      symbols[at] = symbol;
      do {
        at = (at + step) & (size - 1);
      } while (at >= end);
    }
  });
  const bits = new Uint8Array(size);
  const bases = new Uint16Array(size);
  for (let state = 0; state < size; state++) {
    const number = next[symbols[state]]++;
    bits[state] = log - (31 - Math.clz32(number));
    bases[state] = (number << bits[state]) - size;
  }
  return { log, symbols, bits, bases };
}

export function singleState(symbol: number): StateTable {
  return { log: 0, symbols: Uint8Array.of(symbol), bits: new Uint8Array(1), bases: new Uint16Array(1) };
}

/** Reads the description of a table; returns it and the bytes that it takes. */
export function readStateTable(bytes: Uint8Array, mostLog: number, mostSymbols: number): [StateTable, number] {
  let position = 0;
  const peek = (count: number): number => {
    const at = position >> 3;
    const word = bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16);
    return (word >>> (position & 7)) & ((1 << count) - 1);
  };
  const read = (count: number): number => {
    const value = peek(count);
    position += count;
    return value;
  };
  const log = read(4) + 5;
  if (log > mostLog) throw new Error('a table is too large');
  const counts: number[] = [];
  let left = 1 << log;
  while (left > 0 && counts.length < mostSymbols) {
    // Values up to `left + 1` are coded: small ones take a bit less.
    const width = 32 - Math.clz32(left + 1);
    const half = 1 << (width - 1);
    const short = (1 << width) - 2 - left;
    let value = peek(width) & (half - 1);
    if (value < short) {
      position += width - 1;
    } else {
      value = read(width);
      if (value >= half) value -= short;
    }
    const count = value - 1;
    counts.push(count);
    left -= Math.abs(count);
    for (let more = count === 0 ? 3 : 0; more === 3;) {
      more = read(2);
      for (let k = 0; k < more && counts.length < mostSymbols; k++) counts.push(0);
    }
  }
  const used = (position + 7) >> 3;
  if (left !== 0 || used > bytes.length) throw new Error('a table is impossible');
  return [stateTable(counts, log), used];
}

/** Reads the description of Huffman codes; returns their table and the bytes that it takes. */
export function readHuffmanTable(bytes: Uint8Array): [HuffmanTable, number] {
  const size = bytes[0];
  const used = 1 + (size < 128 ? size : (size - 126) >> 1);
  if (!(used <= bytes.length)) throw new Error('it is cut');
  const described = bytes.subarray(1, used);
  const weights =
    size < 128
      ? codedWeights(described)
      : Array.from({ length: size - 127 }, (_, k) => (k % 2 === 0 ? described[k >> 1] >> 4 : described[k >> 1] & 15));
  const sum = weights.reduce((total, weight) => total + ((1 << weight) >> 1), 0);
  const log = 32 - Math.clz32(sum);
  const rest = (1 << log) - sum;
  if (sum === 0 || log > LONGEST_CODE || (rest & (rest - 1)) !== 0) throw new Error('its codes are impossible');
  // The last weight is what makes the codes complete.
  weights.push(32 - Math.clz32(rest));
  const symbols = new Uint8Array(1 << log);
  const bits = new Uint8Array(1 << log);
  let at = 0;
  for (let weight = 1; weight <= log; weight++) {
    const length = 1 << (weight - 1);
    weights.forEach((other, symbol) => {
      if (other === weight) {
        symbols.fill(symbol, at, at + length);
        bits.fill(log + 1 - weight, at, at + length);
        at += length;
      }
    });
  }
  return [{ log, symbols, bits }, used];
}

/** Weights that are coded by two states that take turns. */
function codedWeights(bytes: Uint8Array): number[] {
  const [table, used] = readStateTable(bytes, WEIGHT_LOG, LONGEST_CODE + 2);
  const bits = new BackwardBits(bytes.subarray(used));
  const states = [bits.read(table.log), bits.read(table.log)];
  const weights: number[] = [];
  for (let turn = 0; weights.length < MAX_WEIGHTS; turn = 1 - turn) {
    const state = states[turn];
    weights.push(table.symbols[state]);
    states[turn] = table.bases[state] + bits.read(table.bits[state]);
    if (bits.left < 0) {
      weights.push(table.symbols[states[1 - turn]]);
      return weights;
    }
  }
  throw new Error('its codes are impossible');
}

/** Decodes a stream of Huffman codes, exactly as many as there is room for. */
export function decodeHuffman(stream: Uint8Array, { log, symbols, bits }: HuffmanTable, out: Uint8Array): void {
  const source = new BackwardBits(stream);
  const mask = (1 << log) - 1;
  let state = source.read(log);
  for (let k = 0; k < out.length; k++) {
    out[k] = symbols[state];
    const length = bits[state];
    state = ((state << length) | source.read(length)) & mask;
  }
  if (source.left !== -log) throw new Error('its codes do not end where they should');
}
