/** The sections after the frames: errors, numbers and the report. */

import type { FrameErrors, StaticPart } from '../capture';
import type { Codec } from '../codec/client';
import { decodePayload } from './codecs';
import { damaged } from './error';
import { located, type Section } from './meshes';
import { CODEC } from './section';

const ROUNDED = 1 + 1 / 1024;

export const NO_ERRORS: FrameErrors = { l2: new Float32Array(0), linf: new Float32Array(0) };

/** `ERRS`: errors of all of so many frames. */
export async function decodeErrors({ entry, payload }: Section, frames: number, codec: Codec): Promise<FrameErrors> {
  if (entry.fields.codec === CODEC.codedStatic) return located(entry, codec.call('errors', [payload, frames]));
  const pairs = new Float32Array(decodePayload(entry, payload).buffer);
  const take = (place: number) => Float32Array.from({ length: pairs.length / 2 }, (_, k) => pairs[2 * k + place]);
  return { l2: take(0), linf: take(1) };
}

/** Files keep few digits of an error, rounded up: what passes a guaranteed error by that alone is the guaranteed one. */
export function heldToBound({ l2, linf }: FrameErrors, report: StaticPart['report']): FrameErrors {
  const bound = (report?.coding as { max_error?: unknown } | null | undefined)?.max_error;
  if (typeof bound !== 'number') return { l2, linf };
  const held = (error: number) => (error >= bound && error < bound * ROUNDED ? bound : error);
  return { l2: l2.map(held), linf: linf.map(held) };
}

/** `fnum`: the number of each frame where it comes from. */
export function decodeFrameNumbers({ entry, payload }: Section): Float64Array {
  const numbers = new Float64Array(decodePayload(entry, payload).buffer);
  if (!numbers.every((x, k) => Number.isFinite(x) && (k === 0 || numbers[k - 1] < x)))
    throw damaged(entry.offset, 'the numbers of the frames do not ascend');
  return numbers;
}

/** `summ`: figures about the encoding. */
export function decodeReport({ entry, payload }: Section): Readonly<Record<string, unknown>> {
  let report: unknown;
  try {
    report = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(decodePayload(entry, payload)));
  } catch (error) {
    if (error instanceof SyntaxError || error instanceof TypeError)
      throw damaged(entry.offset, 'the report cannot be read');
    throw error;
  }
  if (typeof report !== 'object' || report === null || Array.isArray(report))
    throw damaged(entry.offset, 'the report is not an object');
  return report as Record<string, unknown>;
}
