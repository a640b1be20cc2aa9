/** Decompression of one zstd frame (RFC 8878) whose size is known: it writes no more than that, whatever the frame says. */

import { BlockDecoder, MAX_BLOCK } from './zstdBlock';

/**
 * Decompresses to exactly `size` bytes.
 *
 * @throws {Error} whose message is part of a sentence.
 */
export function decompress(frame: Uint8Array, size: number): Uint8Array<ArrayBuffer> {
  const { start, hasChecksum } = readHeader(frame, size);
  const out = new Uint8Array(size);
  const decoder = new BlockDecoder();
  let [at, end] = [start, 0];
  for (let isLast = false; !isLast;) {
    if (at + 3 > frame.length) throw new Error('it is cut');
    const header = frame[at] | (frame[at + 1] << 8) | (frame[at + 2] << 16);
    const [kind, length] = [(header >> 1) & 3, header >> 3];
    isLast = (header & 1) === 1;
    at += 3;
    // A repeated byte is one byte whatever its length.
    const stored = kind === 1 ? 1 : length;
    if (kind === 3 || length > MAX_BLOCK || at + stored > frame.length) throw new Error('a block is impossible');
    const block = frame.subarray(at, at + stored);
    if (kind === 2) {
      end = decoder.decode(block, out, end);
    } else {
      if (length > size - end) throw new Error('it is longer than declared');
      if (kind === 0) out.set(block, end);
      else out.fill(block[0], end, end + length);
      end += length;
    }
    at += stored;
  }
  if (end !== size) throw new Error('it is shorter than declared');
  if (at + (hasChecksum ? 4 : 0) !== frame.length) throw new Error('it is cut, or followed by other bytes');
  return out;
}

/** Checks the header of a frame; returns where its blocks begin. */
function readHeader(frame: Uint8Array, size: number): { start: number; hasChecksum: boolean } {
  const magic = [0x28, 0xb5, 0x2f, 0xfd];
  if (frame.length < 9 || magic.some((byte, k) => frame[k] !== byte)) throw new Error('it is not of zstd');
  const descriptor = frame[4];
  const isSingleSegment = (descriptor & 0x20) !== 0;
  if ((descriptor & 8) !== 0 || (descriptor & 3) !== 0) throw new Error('it needs a dictionary or a newer zstd');
  const sizeAt = isSingleSegment ? 5 : 6;
  const sizeBytes = descriptor >> 6 === 0 ? Number(isSingleSegment) : 2 ** (descriptor >> 6);
  if (sizeBytes > 0 && contentSize(frame.subarray(sizeAt, sizeAt + sizeBytes)) !== size)
    throw new Error('it does not have the declared size');
  return { start: sizeAt + sizeBytes, hasChecksum: (descriptor & 4) !== 0 };
}

/** The frame's own count of its bytes; of two bytes, 256 are added. */
function contentSize(bytes: Uint8Array): number {
  const number = bytes.reduceRight((number, byte) => number * 256 + byte, 0);
  return bytes.length === 2 ? number + 256 : number;
}
