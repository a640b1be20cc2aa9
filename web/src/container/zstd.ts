/** Decompression of one zstd frame (RFC 8878) whose size is known, with the checks that fzstd leaves out. */

import { Decompress } from 'fzstd';

/** Largest window that a writer of containers asks for. */
const MOST_WINDOW = 2 ** 24;
const MOST_BLOCK = 2 ** 17;

/**
 * Decompresses to exactly `size` bytes.
 *
 * @throws {Error} whose message is part of a sentence.
 */
export function decompress(frame: Uint8Array, size: number): Uint8Array<ArrayBuffer> {
  checkFrame(frame, size);
  const out = new Uint8Array(size);
  let length = 0;
  const stream = new Decompress((piece) => {
    if (piece.length > size - length) {
      throw new Error('it is longer than declared');
    }
    out.set(piece, length);
    length += piece.length;
  });
  stream.push(frame, true);
  if (length !== size) {
    throw new Error('it is shorter than declared');
  }
  return out;
}

/** Checks the headers of the frame and of its blocks: a decoder allocates what they ask for. */
function checkFrame(frame: Uint8Array, size: number): void {
  const magic = [0x28, 0xb5, 0x2f, 0xfd];
  if (frame.length < 9 || magic.some((byte, k) => frame[k] !== byte)) {
    throw new Error('it is not of zstd');
  }
  const descriptor = frame[4];
  const isSingleSegment = (descriptor & 0x20) !== 0;
  const hasChecksum = (descriptor & 4) !== 0;
  if ((descriptor & 8) !== 0 || (descriptor & 3) !== 0) {
    throw new Error('it needs a dictionary or a newer zstd');
  }
  let at = 5;
  if (!isSingleSegment) {
    const base = 2 ** (10 + (frame[at] >> 3));
    if (base + (base / 8) * (frame[at] & 7) > MOST_WINDOW) {
      throw new Error('its window is too large');
    }
    at++;
  }
  const sizeBytes = descriptor >> 6 === 0 ? Number(isSingleSegment) : 2 ** (descriptor >> 6);
  if (sizeBytes > 0 && contentSize(frame.subarray(at, at + sizeBytes)) !== size) {
    throw new Error('it does not have the declared size');
  }
  at += sizeBytes;
  let isLast = false;
  while (!isLast) {
    if (at + 3 > frame.length) {
      throw new Error('it is cut');
    }
    const header = frame[at] | (frame[at + 1] << 8) | (frame[at + 2] << 16);
    const [kind, length] = [(header >> 1) & 3, header >> 3];
    if (kind === 3 || length > MOST_BLOCK) {
      throw new Error('a block is impossible');
    }
    isLast = (header & 1) === 1;
    // A repeated byte is one byte whatever its length.
    at += 3 + (kind === 1 ? 1 : length);
  }
  if (at + (hasChecksum ? 4 : 0) !== frame.length) {
    throw new Error('it is cut, or followed by other bytes');
  }
}

/** The frame's own count of its bytes; of two bytes, 256 are added. */
function contentSize(bytes: Uint8Array): number {
  const number = bytes.reduceRight((number, byte) => number * 256 + byte, 0);
  return bytes.length === 2 ? number + 256 : number;
}
