/** What the tests of containers share: golden files, containers put together by hand, and positions. */

import { readdirSync, readFileSync } from 'node:fs';
import type { Capture, FrameBlock, StaticPart } from '../../src/capture';
import { LocalCodec } from './localCodec';
import { addResidual } from '../../src/codec/residual';
import { columnsOf, computeCoordinates } from '../../src/coordinates/compute';
import { TiedNormals } from '../../src/coordinates/tiedNormals';
import { crc32c } from '../../src/container/crc32c';
import { type ContainerCapture, openContainer, type OpenOptions } from '../../src/container/open';
import {
  ENTRY_BYTES,
  FOOTER_BYTES,
  HEADER_BYTES,
  parseFields,
  PRELUDE_BYTES,
  viewOf,
} from '../../src/container/section';
import { bytesSource } from '../../src/container/source';
import { ContainerStream } from '../../src/container/stream';

const FOLDER = new URL('../../../tests/golden/', import.meta.url);

/** Names of the golden files, without their ending. */
export const GOLDEN = readdirSync(FOLDER)
  .filter((name) => name.endsWith('.cager'))
  .map((name) => name.slice(0, -'.cager'.length));

export function goldenBytes(name: string): Uint8Array<ArrayBuffer> {
  return new Uint8Array(readFileSync(new URL(`${name}.cager`, FOLDER)));
}

/** Positions that a golden file decodes to, frames × points × 3; in double precision where it has an origin. */
export function goldenPositions(name: string): Float32Array | Float64Array {
  const bytes = new Uint8Array(readFileSync(new URL(`${name}.npy`, FOLDER)));
  const { buffer } = bytes.slice(10 + viewOf(bytes).getUint16(8, true));
  return name.endsWith('-origin') ? new Float64Array(buffer) : new Float32Array(buffer);
}

/** Opens bytes and decodes in this thread. */
export function openBytes(bytes: Uint8Array, options: OpenOptions = {}): Promise<ContainerCapture> {
  return openContainer(bytesSource(bytes), { codec: new LocalCodec(), ...options });
}

/** Model and cage of a container that arrives in pieces of so many bytes; null where they do not come. */
export async function streamedPart(bytes: Uint8Array, piece = bytes.length): Promise<StaticPart | null> {
  const stream = new ContainerStream();
  for (let at = 0; at < bytes.length; at += piece) {
    if (stream.begin(bytes.subarray(at, at + piece))) return stream.decodeStatic(new LocalCodec());
  }
  return null;
}

/** All blocks of a capture. */
export async function allBlocks(capture: Capture): Promise<FrameBlock[]> {
  const blocks: FrameBlock[] = [];
  for (let frame = 0; frame < capture.frames; frame += blocks[blocks.length - 1].count) {
    blocks.push(await capture.block(frame));
  }
  return blocks;
}

/** Positions of all frames of some blocks, frames × points × 3, multiplied as the program does: in single precision, about the cage's centre. */
export function positionsOf(
  part: StaticPart,
  blocks: readonly FrameBlock[],
  phi: Float32Array = Float32Array.from(computeCoordinates(part.system, part.cage, part.rest)),
): Float32Array {
  const length = 3 * (part.rest.length / 3);
  const all = new Float32Array(length * blocks.reduce((sum, { count }) => sum + count, 0));
  const columns = columnsOf(part.system, part.cage);
  const vertices = part.cage.positions.length / 3;
  const normals = part.system === 'green' ? new TiedNormals(part.cage) : null;
  const rows = new Float64Array(3 * columns);
  const stored = 3 * part.rowsPerFrame;
  for (const { first, count, cages, residual } of blocks) {
    for (let frame = 0; frame < count; frame++) {
      rows.set(cages.subarray(frame * stored, (frame + 1) * stored));
      normals?.write(rows.slice(0, stored), rows, stored);
      const positions = all.subarray((first + frame) * length, (first + frame + 1) * length);
      for (let axis = 0; axis < 3; axis++) {
        let centre = 0;
        for (let j = 0; j < vertices; j++) {
          centre += rows[3 * j + axis] / vertices;
        }
        for (let at = axis, row = 0; at < length; at += 3, row += columns) {
          let sum = 0;
          for (let j = 0; j < columns; j++) {
            const value = Math.fround(rows[3 * j + axis] - (j < vertices ? centre : 0));
            sum = Math.fround(sum + phi[row + j] * value);
          }
          positions[at] = sum + centre;
        }
      }
      if (residual !== null) {
        addResidual(residual, frame, positions);
      }
    }
  }
  return all;
}

/** A section as the bytes of its header and its payload. */
export interface Part {
  readonly header: Uint8Array<ArrayBuffer>;
  readonly payload: Uint8Array<ArrayBuffer>;
}

/** The sections of an intact container, without the table of contents. */
export function takeApart(bytes: Uint8Array): Part[] {
  const parts: Part[] = [];
  for (let at = PRELUDE_BYTES; ;) {
    const header = bytes.slice(at, at + HEADER_BYTES);
    const { tag, payloadBytes } = parseFields(header, at);
    if (tag === 'TOC_') {
      return parts;
    }
    const start = at + HEADER_BYTES;
    parts.push({ header, payload: bytes.slice(start, start + payloadBytes) });
    at = start + payloadBytes;
  }
}

/** A raw section. */
export function rawPart(tag: string, payload: Uint8Array<ArrayBuffer>, width = 1): Part {
  const header = new Uint8Array(HEADER_BYTES);
  header.set(new TextEncoder().encode(tag));
  header[5] = width;
  viewOf(header).setBigUint64(24, BigInt(payload.length), true);
  return { header, payload };
}

/** A container of these sections: lengths and checksums are made to fit, sizes of decoded content are not. */
export function putTogether(parts: readonly Part[]): Uint8Array<ArrayBuffer> {
  const entries = new Uint8Array(ENTRY_BYTES * parts.length);
  const contents = rawPart('TOC_', entries);
  const length = [...parts, contents].reduce((sum, { payload }) => sum + HEADER_BYTES + payload.length, PRELUDE_BYTES);
  const bytes = new Uint8Array(length + FOOTER_BYTES);
  bytes.set([0x89, 0x43, 0x47, 0x52, 0x0d, 0x0a, 0x1a, 0x0a, 1]);
  sign(bytes.subarray(0, PRELUDE_BYTES));
  let at = PRELUDE_BYTES;
  [...parts, contents].forEach(({ header, payload }, k) => {
    const place = bytes.subarray(at, at + HEADER_BYTES);
    place.set(header);
    viewOf(place).setBigUint64(16, BigInt(payload.length), true);
    viewOf(place).setUint32(32, crc32c(payload), true);
    sign(place);
    bytes.set(payload, at + HEADER_BYTES);
    if (k < parts.length) {
      viewOf(entries).setBigUint64(ENTRY_BYTES * k, BigInt(at), true);
      entries.set(place.subarray(0, 32), ENTRY_BYTES * k + 8);
    }
    at += HEADER_BYTES + payload.length;
  });
  const footer = bytes.subarray(length);
  viewOf(footer).setBigUint64(0, BigInt(length - HEADER_BYTES - entries.length), true);
  viewOf(footer).setBigUint64(8, BigInt(bytes.length), true);
  footer.set(new TextEncoder().encode('CGRE'), 16);
  sign(footer);
  return bytes;
}

/** The container with one more section, right behind the one with a tag. */
export function withPart(bytes: Uint8Array, part: Part, behind: string): Uint8Array<ArrayBuffer> {
  const parts = takeApart(bytes);
  const place = parts.findIndex(({ header }) => parseFields(header, 0).tag === behind);
  return putTogether([...parts.slice(0, place + 1), part, ...parts.slice(place + 1)]);
}

/** Where the first section with this tag begins. */
export function offsetOf(bytes: Uint8Array, tag: string): number {
  let at = PRELUDE_BYTES;
  for (const { header, payload } of takeApart(bytes)) {
    if (parseFields(header, at).tag === tag) {
      return at;
    }
    at += HEADER_BYTES + payload.length;
  }
  throw new Error(`there is no section ${tag}`);
}

/** Puts the checksum of the bytes before it into the last four. */
export function sign(bytes: Uint8Array): void {
  viewOf(bytes).setUint32(bytes.length - 4, crc32c(bytes.subarray(0, -4)), true);
}

/** Numbers that look random and are the same each time (xorshift of 32 bits), from 0 up to `below` − 1. */
export function randomNumbers(seed: number): (below: number) => number {
  let state = seed;
  return (below) => {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    return (state >>> 0) % below;
  };
}
