/** Coded groups of frames as the service sent them, as far as they fit into memory. */

import { GROUP_BYTES } from '../cacheBytes';
import type { StoredChunk, StoredSection } from '../container/stream';
import { HEADER_BYTES } from '../container/section';
import type { Source } from '../container/source';

/** Keeps groups in the order of their frames; the earliest ones go first. */
export class GroupStore {
  private readonly groups: StoredChunk[] = [];
  private keptBytes = 0;

  constructor(private readonly mostBytes = GROUP_BYTES) {}

  /** Takes the group that follows the last one. */
  put(group: StoredChunk) {
    this.groups.push(group);
    this.keptBytes += bytesOf(group);
    while (this.keptBytes > this.mostBytes && this.groups.length > 1) this.keptBytes -= bytesOf(this.groups.shift()!);
  }

  of(frame: number): StoredChunk | null {
    return this.groups.find((group) => isWithin(group, frame)) ?? null;
  }

  /**
   * The container, once the session is completed: what is here of it is not read again.
   *
   * @param source where all of it can be read
   * @param frames number of frames it has: groups beyond were left out
   */
  source(source: Source, frames: number): Source {
    const held = this.groups.filter((group) => endOf(group) <= frames).flatMap(piecesOf);
    return {
      size: source.size,
      read: (offset, length, signal) => {
        const bytes = within(held, offset, length);
        return bytes ? Promise.resolve(bytes) : source.read(offset, length, signal);
      },
    };
  }
}

export function endOf({ frames: { entry } }: StoredChunk): number {
  return entry.fields.first + entry.fields.count;
}

function isWithin(group: StoredChunk, frame: number): boolean {
  return frame >= group.frames.entry.fields.first && frame < endOf(group);
}

interface Piece {
  readonly offset: number;
  readonly bytes: Uint8Array;
}

function piecesOf({ residual, frames }: StoredChunk): Piece[] {
  return (residual ? [residual, frames] : [frames]).flatMap(({ entry: { offset }, header, payload }) => {
    return [
      { offset, bytes: header },
      { offset: offset + HEADER_BYTES, bytes: payload },
    ];
  });
}

/** So many bytes from an offset on; null where they are not all in the pieces, which ascend. */
function within(pieces: readonly Piece[], offset: number, length: number): Uint8Array | null {
  const found = new Uint8Array(length);
  let filled = 0;
  for (const { offset: start, bytes } of pieces) {
    const from = offset + filled - start;
    if (from < 0) return null;
    if (from >= bytes.length) continue;
    const part = bytes.subarray(from, from + length - filled);
    found.set(part, filled);
    filled += part.length;
    if (filled === length) return found;
  }
  return null;
}

function bytesOf({ frames, residual }: StoredChunk): number {
  return sizeOf(frames) + (residual ? sizeOf(residual) : 0);
}

function sizeOf({ payload }: StoredSection): number {
  return HEADER_BYTES + payload.length;
}
