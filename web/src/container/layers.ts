/** Edits as layers over the frames of a container: sections `EDIT`; docs/FORMAT.md. */

import type { EditLayer, FrameBlock, FrameErrors } from '../capture';
import { decodePayload } from './codecs';
import { damaged } from './error';
import type { Head } from './head';
import type { Section } from './meshes';
import { type Entry, viewOf } from './section';

const OFF = 1;
const MAX_NAME_BYTES = 256;
/** Differences of so many units in the last place of the larger coordinate are those of rounding. */
const ROUNDING_ULPS = 4;

/** A layer as it is in a file. */
export interface StoredLayer extends EditLayer {
  readonly stored: { readonly entry: Entry; readonly isOn: boolean };
}

/** Decodes an edit of a capture with so many frames. */
export function decodeLayer({ entry, payload }: Section, head: Head, frames: number): StoredLayer {
  const { first, count, rawBytes } = entry.fields;
  const check = (holds: boolean, what: string) => {
    if (!holds) throw damaged(entry.offset, what);
  };
  check(count > 0 && first + count <= frames, 'an edit is of frames that there are not');
  const raw = decodePayload(entry, payload);
  check(raw.length >= 8, 'an edit is cut');
  const view = viewOf(raw);
  const [flags, vertexCount] = [view.getUint32(0, true), view.getUint32(4, true)];
  const named = 8 + 4 * vertexCount + 12 * count * vertexCount;
  check((flags & ~OFF) === 0, 'an edit has unknown flags');
  check(vertexCount > 0 && named <= rawBytes && rawBytes <= named + MAX_NAME_BYTES, 'an edit has an impossible size');
  const vertices = new Uint32Array(raw.slice(8, 8 + 4 * vertexCount).buffer);
  const ascend = vertices.every((vertex, k) => vertex < head.cageVertices && (k === 0 || vertices[k - 1] < vertex));
  check(ascend, 'an edit has vertices that the cage has not, or not in order');
  const offsets = new Float32Array(raw.slice(8 + 4 * vertexCount, named).buffer);
  check(offsets.every(Number.isFinite), 'an edit is not finite');
  let name = '';
  try {
    name = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true }).decode(raw.subarray(named));
  } catch {
    check(false, 'the name of an edit cannot be read');
  }
  const isOn = flags === 0;
  return { name, isOn, first, count, vertices, offsets, stored: { entry, isOn } };
}

/** The raw content of a layer's section. */
export function encodeLayer({ name, isOn, vertices, offsets }: EditLayer): Uint8Array<ArrayBuffer> {
  let text = new TextEncoder().encode(name);
  // A cut within a character would leave a name that cannot be read.
  if (text.length > MAX_NAME_BYTES) text = new TextEncoder().encode(name.slice(0, MAX_NAME_BYTES / 4));
  const bytes = new Uint8Array(8 + 4 * vertices.length + 4 * offsets.length + text.length);
  const view = viewOf(bytes);
  view.setUint32(0, isOn ? 0 : OFF, true);
  view.setUint32(4, vertices.length, true);
  vertices.forEach((vertex, k) => view.setUint32(8 + 4 * k, vertex, true));
  const start = 8 + 4 * vertices.length;
  offsets.forEach((x, k) => view.setFloat32(start + 4 * k, x, true));
  bytes.set(text, start + 4 * offsets.length);
  return bytes;
}

/** A block with the layers that are on, added in double precision and rounded once; the block itself stays as it is. */
export function withLayers(block: FrameBlock, layers: readonly EditLayer[], rowsPerFrame: number): FrameBlock {
  const concerned = layers.filter(({ isOn, first, count }) => {
    return isOn && first < block.first + block.count && block.first < first + count;
  });
  if (concerned.length === 0) return block;
  const sums = Float64Array.from(block.cages);
  for (const { first, count, vertices, offsets } of concerned) {
    const end = Math.min(first + count, block.first + block.count);
    for (let frame = Math.max(first, block.first); frame < end; frame++) {
      const from = 3 * vertices.length * (frame - first);
      const to = 3 * rowsPerFrame * (frame - block.first);
      vertices.forEach((vertex, k) => {
        for (let axis = 0; axis < 3; axis++) sums[to + 3 * vertex + axis] += offsets[from + 3 * k + axis];
      });
    }
  }
  const cages = Float32Array.from(sums);
  if (!cages.every(Number.isFinite)) throw damaged(0, 'a cage is not finite with the edits of the file');
  return { ...block, cages };
}

/** Errors of frames without those that were measured of other cages than the layers leave. */
export function withoutErrors(errors: FrameErrors, layers: readonly EditLayer[]): FrameErrors {
  if (!layers.some(({ isOn }) => isOn)) return errors;
  const [l2, linf] = [errors.l2.slice(), errors.linf.slice()];
  for (const { first, count } of layers.filter(({ isOn }) => isOn)) {
    l2.fill(NaN, first, first + count);
    linf.fill(NaN, first, first + count);
  }
  return { l2, linf };
}

/**
 * The layer that leads from some cages to others, both of the frames from `first` on, vertices x y z each, more of them before or not; null where they are the same but for rounding. It has the
 * frames from the first to the last that differ, and the vertices that do.
 *
 * @throws Error with one sentence for a person where a difference does not fit into single precision
 */
export function layerBetween(
  before: readonly Float32Array[],
  after: readonly Float32Array[],
  first: number,
  name: string,
): EditLayer | null {
  const changes = before.map((rows, k) => {
    const found = new Map<number, number>();
    after[k].forEach((x, at) => {
      const difference = differenceOf(rows[at], x);
      if (!Number.isFinite(difference))
        throw new Error(`A vertex of frame ${first + k} is too far away to be stored; move it closer.`);
      if (difference !== 0) found.set(at, difference);
    });
    return found;
  });
  const start = changes.findIndex(({ size }) => size > 0);
  if (start < 0) return null;
  const frames = changes.slice(start, changes.findLastIndex(({ size }) => size > 0) + 1);
  const differing = frames.flatMap((found) => [...found.keys()].map((at) => Math.floor(at / 3)));
  const vertices = Uint32Array.from(new Set(differing)).sort();
  const offsets = new Float32Array(3 * vertices.length * frames.length);
  frames.forEach((found, k) =>
    vertices.forEach((vertex, v) => {
      const to = 3 * (k * vertices.length + v);
      for (let axis = 0; axis < 3; axis++) offsets[to + axis] = found.get(3 * vertex + axis) ?? 0;
    }),
  );
  return { name, isOn: true, first: first + start, count: frames.length, vertices, offsets };
}

/** From one coordinate to another; 0 where the difference is no more than four units in the last place of the larger one. */
function differenceOf(a: number, b: number): number {
  if (!Number.isFinite(b)) return b;
  const exponent = Math.max(-126, Math.floor(Math.log2(Math.max(Math.abs(a), Math.abs(b)))));
  return Math.abs(b - a) <= ROUNDING_ULPS * 2 ** (exponent - 23) ? 0 : Math.fround(b - a);
}
