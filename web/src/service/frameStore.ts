/** The solved cages and errors of a running session, as far as they fit into memory. */

import type { FrameBlock, FrameErrors } from '../capture';
import type { CageRecord } from './frameRecords';

/** Most bytes of cages that are kept; what was used least recently goes first. */
const MAX_BYTES = 48 << 20;
const CHUNK_BYTES = 512 << 10;
const CHUNK_FRAMES = 64;

/** Consecutive frames, of which some are there. */
interface Chunk {
  readonly cages: Float32Array;
  readonly there: Uint8Array;
}

/** Keeps cages in chunks of up to 64 frames. */
export class FrameStore {
  readonly chunkFrames: number;
  private readonly stride: number;
  private readonly most: number;
  /** In the order of their last use. */
  private readonly chunks = new Map<number, Chunk>();

  /** @param rows rows of three numbers of a frame */
  constructor(rows: number, mostBytes = MAX_BYTES) {
    this.stride = 3 * rows;
    this.chunkFrames = Math.max(1, Math.min(CHUNK_FRAMES, Math.floor(CHUNK_BYTES / (12 * rows))));
    this.most = Math.max(2, Math.floor(mostBytes / (12 * rows * this.chunkFrames)));
  }

  put(frame: number, rows: Float32Array) {
    const number = Math.floor(frame / this.chunkFrames);
    const chunk = this.use(number) ?? this.add(number);
    const at = frame - number * this.chunkFrames;
    chunk.cages.set(rows, at * this.stride);
    chunk.there[at] = 1;
  }

  /** The frames around `frame` that are there without a gap, up to the ends of its chunk; null where it is not there itself. */
  block(frame: number): FrameBlock | null {
    const number = Math.floor(frame / this.chunkFrames);
    const chunk = this.use(number);
    const at = frame - number * this.chunkFrames;
    if (!chunk?.there[at]) return null;
    let [first, end] = [at, at + 1];
    while (first > 0 && chunk.there[first - 1]) first -= 1;
    while (end < this.chunkFrames && chunk.there[end]) end += 1;
    const cages = chunk.cages.subarray(first * this.stride, end * this.stride);
    return { first: number * this.chunkFrames + first, count: end - first, cages, residual: null };
  }

  private use(number: number): Chunk | undefined {
    const chunk = this.chunks.get(number);
    if (chunk) {
      this.chunks.delete(number);
      this.chunks.set(number, chunk);
    }
    return chunk;
  }

  private add(number: number): Chunk {
    const chunk = {
      cages: new Float32Array(this.chunkFrames * this.stride),
      there: new Uint8Array(this.chunkFrames),
    };
    this.chunks.set(number, chunk);
    for (const oldest of this.chunks.keys()) {
      if (this.chunks.size <= this.most) break;
      this.chunks.delete(oldest);
    }
    return chunk;
  }
}

export class GrowingErrors {
  private l2 = new Float32Array(256).fill(Number.NaN);
  private linf = new Float32Array(256).fill(Number.NaN);

  put(frame: number, l2: number | null, linf: number | null) {
    if (frame >= this.l2.length) {
      const length = 2 ** Math.ceil(Math.log2(frame + 1));
      this.l2 = grown(this.l2, length);
      this.linf = grown(this.linf, length);
    }
    this.l2[frame] = l2 ?? Number.NaN;
    this.linf[frame] = linf ?? Number.NaN;
  }

  putRecord(record: CageRecord) {
    this.put(record.frame, record.l2, record.linf);
  }

  /** Errors of the first `frames` frames; at most as many as are held. */
  upTo(frames: number): FrameErrors {
    return { l2: this.l2.subarray(0, frames), linf: this.linf.subarray(0, frames) };
  }
}

function grown(values: Float32Array, length: number): Float32Array<ArrayBuffer> {
  const more = new Float32Array(length).fill(Number.NaN);
  more.set(values);
  return more;
}
