/** Lossless codecs for arrays of numbers: byte planes and zstd, with a difference along the array before them. */

import { damaged, unknownFeature } from './error';
import { CODEC, type Entry } from './section';
import { decompress } from './zstd';

/**
 * Decodes a section's payload to its raw bytes, which are at the beginning of a buffer of their own.
 *
 * @param stride words between the ones that the codec "difference" subtracts from each other.
 */
export function decodePayload({ fields, offset }: Entry, payload: Uint8Array, stride = 1): Uint8Array<ArrayBuffer> {
  const { codec, rawBytes, width } = fields;
  if (codec === CODEC.raw) {
    if (payload.length !== rawBytes) throw damaged(offset, 'a section does not have the size it declares');
    return payload.slice();
  }
  if (codec !== CODEC.planes && codec !== CODEC.difference)
    throw unknownFeature(`codec ${codec} of the section ${fields.tag}`);
  if (codec === CODEC.difference && rawBytes % 4 !== 0)
    throw damaged(offset, 'a section does not have the size it declares');
  let planes: Uint8Array<ArrayBuffer>;
  try {
    planes = decompress(payload, rawBytes);
  } catch (error) {
    const reason = error instanceof Error ? error.message : 'it is damaged';
    throw damaged(offset, `a section cannot be decompressed (${reason})`);
  }
  if (codec === CODEC.planes) return joinPlanes(planes, width);
  const words = new Uint32Array(joinPlanes(planes, 4).buffer);
  undoDifferences(words, stride);
  return new Uint8Array(words.buffer);
}

function joinPlanes(planes: Uint8Array<ArrayBuffer>, width: number): Uint8Array<ArrayBuffer> {
  if (width === 1) return planes;
  const count = Math.floor(planes.length / width);
  const out = new Uint8Array(planes.length);
  for (let plane = 0; plane < width; plane++) {
    for (let k = 0, from = plane * count, to = plane; k < count; k++, from++, to += width) out[to] = planes[from];
  }
  out.set(planes.subarray(count * width), count * width);
  return out;
}

function undoDifferences(words: Uint32Array, stride: number): void {
  for (let k = 0; k < words.length; k++) {
    const difference = (words[k] >>> 1) ^ -(words[k] & 1);
    words[k] = k < stride ? difference : difference + words[k - stride];
  }
}
