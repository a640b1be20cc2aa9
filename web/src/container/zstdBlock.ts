/** Compressed blocks of zstd (RFC 8878, section 3.1.1.3). */

import {
  BackwardBits,
  decodeHuffman,
  readHuffmanTable,
  readStateTable,
  singleState,
  stateTable,
  type HuffmanTable,
  type StateTable,
} from './zstdEntropy';

/** Most bytes that a block may have, compressed or not. */
export const MAX_BLOCK = 2 ** 17;

/** Bits that follow a code, and the smallest number of the code. */
interface Lengths {
  readonly bits: Uint8Array;
  readonly bases: Uint32Array;
}

function lengths(first: number, plain: number, bits: readonly number[]): Lengths {
  const all = Uint8Array.from([...new Array<number>(plain).fill(0), ...bits]);
  const bases = new Uint32Array(all.length);
  all.forEach((_, code) => (bases[code] = code === 0 ? first : bases[code - 1] + 2 ** all[code - 1]));
  return { bits: all, bases };
}

const LITERAL_LENGTHS = lengths(0, 16, [1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);
const MATCH_LENGTHS = lengths(3, 32, [1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);
const LONGEST_OFFSET = 30;

/** Of the codes of literals' lengths, offsets and matches' lengths: the usual counts, the largest table and the number of codes. */
const KINDS = [
  {
    usual: stateTable(
      [4, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 2, 1, 1, 1, 1, 1, -1, -1, -1, -1],
      6,
    ),
    log: 9,
    codes: LITERAL_LENGTHS.bits.length,
  },
  {
    usual: stateTable([1, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1], 5),
    log: 8,
    codes: LONGEST_OFFSET + 1,
  },
  {
    usual: stateTable([1, 4, 3, 2, 2, 2, 2, 2, 2, ...new Array<number>(37).fill(1), -1, -1, -1, -1, -1, -1, -1], 6),
    log: 9,
    codes: MATCH_LENGTHS.bits.length,
  },
] as const;

export class BlockDecoder {
  private huffman: HuffmanTable | null = null;
  private tables: StateTable[] = [];
  private readonly recent = [1, 4, 8];

  /** Decodes a block into `out` from `start` on; returns where it ends there. */
  decode(block: Uint8Array, out: Uint8Array, start: number): number {
    const [literals, used] = this.literals(block);
    const most = Math.min(out.length, start + MAX_BLOCK);
    return this.sequences(block.subarray(used), literals, out, start, most);
  }

  /** The literals, and the bytes that they take. */
  private literals(block: Uint8Array): [Uint8Array, number] {
    const kind = block[0] & 3;
    const format = (block[0] >> 2) & 3;
    const isCoded = kind > 1;
    // The header has 5 or 12 or 20 bits of a size, or twice 10, 14 or 18.
    const headerBytes = isCoded ? [3, 3, 4, 5][format] : [1, 2, 1, 3][format];
    const width = isCoded ? [10, 10, 14, 18][format] : [5, 12, 5, 20][format];
    let header = 0;
    for (let k = headerBytes; k-- > 0;) header = header * 256 + (block[k] ?? 0);
    header = Math.floor(header / (!isCoded && format % 2 === 0 ? 8 : 16));
    const size = header % 2 ** width;
    const stored = isCoded ? Math.floor(header / 2 ** width) : kind === 0 ? size : 1;
    const end = headerBytes + stored;
    if (size > MAX_BLOCK || end > block.length) throw new Error('its literals are too long');
    const bytes = block.subarray(headerBytes, end);
    if (kind === 0) return [bytes, end];
    const literals = new Uint8Array(size);
    if (kind === 1) return [literals.fill(bytes[0]), end];
    let at = 0;
    if (kind === 2) [this.huffman, at] = readHuffmanTable(bytes);
    if (this.huffman === null) throw new Error('its codes are missing');
    if (format === 0) decodeHuffman(bytes.subarray(at), this.huffman, literals);
    else decodeFour(bytes.subarray(at), this.huffman, literals);
    return [literals, end];
  }

  /** Copies literals and matches to `out`, and checks before each that there is room for it. */
  private sequences(bytes: Uint8Array, literals: Uint8Array, out: Uint8Array, start: number, most: number): number {
    let [at, taken] = [start, 0];
    const copyLiterals = (count: number): void => {
      if (count > literals.length - taken || count > most - at) throw new Error('it is longer than declared');
      out.set(literals.subarray(taken, taken + count), at);
      taken += count;
      at += count;
    };
    let count = bytes[0];
    let used = 1;
    if (count > 127) {
      count = count < 255 ? ((count - 128) << 8) + bytes[1] : bytes[1] + (bytes[2] << 8) + 0x7f00;
      used = bytes[0] < 255 ? 2 : 3;
    }
    if (count > 0) {
      used = this.readTables(bytes, used);
      const [literalTable, offsetTable, matchTable] = this.tables;
      const bits = new BackwardBits(bytes.subarray(used));
      let literalState = bits.read(literalTable.log);
      let offsetState = bits.read(offsetTable.log);
      let matchState = bits.read(matchTable.log);
      for (let left = count; ;) {
        const offsetBits = offsetTable.symbols[offsetState];
        const matchCode = matchTable.symbols[matchState];
        const literalCode = literalTable.symbols[literalState];
        // More than 24 bits cannot be read at once.
        const high = offsetBits > 16 ? bits.read(offsetBits - 16) * 2 ** 16 : 0;
        const value = 2 ** offsetBits + high + bits.read(Math.min(offsetBits, 16));
        const matchLength = MATCH_LENGTHS.bases[matchCode] + bits.read(MATCH_LENGTHS.bits[matchCode]);
        const literalLength = LITERAL_LENGTHS.bases[literalCode] + bits.read(LITERAL_LENGTHS.bits[literalCode]);
        copyLiterals(literalLength);
        const offset = this.offsetOf(value, literalLength);
        if (offset > at || offset < 1 || matchLength > most - at)
          throw new Error('it is longer than declared, or refers to what is not there');
        if (offset >= matchLength) {
          out.copyWithin(at, at - offset, at - offset + matchLength);
        } else {
          for (let k = at; k < at + matchLength; k++) out[k] = out[k - offset];
        }
        at += matchLength;
        left--;
        if (left === 0) break;
        literalState = literalTable.bases[literalState] + bits.read(literalTable.bits[literalState]);
        matchState = matchTable.bases[matchState] + bits.read(matchTable.bits[matchState]);
        offsetState = offsetTable.bases[offsetState] + bits.read(offsetTable.bits[offsetState]);
        if (bits.left < 0) throw new Error('it is cut');
      }
      if (bits.left !== 0) throw new Error('its bits do not end where they should');
    }
    copyLiterals(literals.length - taken);
    return at;
  }

  /** Reads which tables the sequences use; returns where they end. */
  private readTables(bytes: Uint8Array, start: number): number {
    const modes = bytes[start];
    let at = start + 1;
    this.tables = KINDS.map(({ usual, log, codes }, kind) => {
      const mode = (modes >> (6 - 2 * kind)) & 3;
      if (mode === 0) return usual;
      if (mode === 1) {
        const code = bytes[at++];
        if (!(code < codes)) throw new Error('a code is impossible');
        return singleState(code);
      }
      if (mode === 2) {
        const [table, used] = readStateTable(bytes.subarray(at), log, codes);
        at += used;
        return table;
      }
      const before = this.tables.at(kind);
      if (before === undefined) throw new Error('a table is missing');
      return before;
    });
    return at;
  }

  /** The distance of a match: one of the last three, or another one, which is then the last. */
  private offsetOf(value: number, literalLength: number): number {
    const { recent } = this;
    const which = literalLength === 0 ? value : value - 1;
    const offset = value > 3 ? value - 3 : which === 3 ? recent[0] - 1 : recent[which];
    if (value > 3 || which > 1) recent[2] = recent[1];
    if (value > 3 || which > 0) {
      recent[1] = recent[0];
      recent[0] = offset;
    }
    return offset;
  }
}

/** Literals in four streams, the first three of the same length. */
function decodeFour(bytes: Uint8Array, table: HuffmanTable, out: Uint8Array): void {
  const part = (out.length + 3) >> 2;
  let at = 6;
  for (let k = 0; k < 4; k++) {
    const length = k < 3 ? bytes[2 * k] | (bytes[2 * k + 1] << 8) : bytes.length - at;
    if (at + length > bytes.length) throw new Error('it is cut');
    decodeHuffman(bytes.subarray(at, at + length), table, out.subarray(part * k, k < 3 ? part * (k + 1) : undefined));
    at += length;
  }
}
