import type { Capture, FrameBlock } from '../capture';
import type { FrameData, FrameStore } from '../render/frameStore';
import { Backoff, pause } from '../service/backoff';
import { ServiceProblem } from '../service/problem';
import { sentence } from '../text';
import { framesAhead, framesAround, type Transport } from './transport';

const AHEAD = 24;

/** What is drawn at a place: a frame, and how much the one after it counts. */
export interface Blend {
  readonly before: number;
  readonly mix: number;
  readonly here: FrameData;
  /** Null where one frame stands alone. */
  readonly there: FrameData | null;
}

export interface FeedListener {
  /** What comes next has changed: frames did not come, or may be asked for again. */
  changed(): void;
  /** Frames are asked for again by themselves, in one sentence. */
  troubled(problem: string): void;
  /** What was said of frames is over: they came. */
  recovered(problem: string): void;
}

/** Frames of a capture for whoever plays it: loads them ahead, waits for those that may still come, and leaves out those that do not. */
export class FrameFeed {
  /** Frames that could not be loaded: they are not asked for again until somebody plays or seeks. */
  readonly holes = new Holes();
  private readonly stop = new AbortController();
  private readonly backoff = new Backoff();
  /** Why nothing is asked for just now, or came of it the last time. */
  private trouble: string | null = null;
  private isPausing = false;

  constructor(
    private readonly capture: Capture,
    private readonly store: FrameStore,
    private readonly listener: FeedListener,
  ) {
    store.onFailure = (frame, error) => this.fail(frame, error);
  }

  /** What is drawn at a place, or the frame that is missing there. */
  at(transport: Transport): Blend | number {
    const { before, after, mix } = this.soundFramesAround(transport);
    const [here, there] = [this.store.peek(before), mix > 0 ? this.store.peek(after) : null];
    if (!here) return before;
    return mix > 0 && !there ? after : { before, mix, here, there };
  }

  prefetch(transport: Transport) {
    if (this.isPausing) return;
    this.store.prefetch([...framesAhead(transport, AHEAD)].filter((frame) => !this.holes.at(frame)));
  }

  load(frame: number) {
    if (this.isPausing) return;
    this.store.load(frame).catch((error: unknown) => this.fail(frame, error));
  }

  /** Whether the frames of a place are there, or will never be; asks for those that are missing. */
  prepare(transport: Transport): boolean {
    const found = this.at(transport);
    this.prefetch(transport);
    if (typeof found !== 'number' || transport.frames === 0 || this.holes.at(found)) return true;
    this.load(found);
    return false;
  }

  /** To be called with every block that came, whoever asked for it. */
  arrived({ first, count }: FrameBlock) {
    for (const problem of this.holes.fill(first, count)) this.listener.recovered(problem);
    this.backoff.reset();
    if (this.trouble !== null) this.listener.recovered(this.trouble);
    this.trouble = null;
  }

  close() {
    this.stop.abort();
    this.store.close();
  }

  private fail(frame: number, error: unknown) {
    if (this.stop.signal.aborted || this.isPausing) return;
    if (error instanceof ServiceProblem && error.passes) {
      void this.pause(error);
      return;
    }
    const { first, count } = this.capture.readTogether?.(frame) ?? { first: frame, count: 1 };
    this.holes.add({ first, count, problem: sentence(error) });
    this.listener.changed();
  }

  private async pause({ message, retryAfter }: ServiceProblem) {
    this.isPausing = true;
    if (this.trouble !== message) this.listener.troubled(message);
    this.trouble = message;
    await pause(this.backoff.next(retryAfter), this.stop.signal).catch(() => undefined);
    this.isPausing = false;
    if (!this.stop.signal.aborted) this.listener.changed();
  }

  /** Frames to blend; the one before a hole stands until it is over. */
  private soundFramesAround(transport: Transport): ReturnType<typeof framesAround> {
    const frames = framesAround(transport);
    return frames.mix > 0 && this.holes.at(frames.after) ? { ...frames, after: frames.before, mix: 0 } : frames;
  }
}

export function blendedRows({ here, there, mix }: Blend): Float32Array | Float64Array {
  if (!there) return here.rows;
  const rows = new Float64Array(here.rows.length);
  for (let k = 0; k < rows.length; k++) rows[k] = here.rows[k] + (there.rows[k] - here.rows[k]) * mix;
  return rows;
}

export interface Hole {
  readonly first: number;
  readonly count: number;
  readonly problem: string;
}

/** Frames that could not be loaded: playing leaves them out. */
export class Holes {
  private readonly holes = new Map<number, Hole>();
  private readonly told = new Set<Hole>();

  add(hole: Hole) {
    if (!this.at(hole.first)) this.holes.set(hole.first, hole);
  }

  /** Forgets holes whose frames came after all; what was said of them. */
  fill(first: number, count: number): string[] {
    const filled = [...this.holes.values()].filter(
      (hole) => hole.first < first + count && first < hole.first + hole.count,
    );
    for (const hole of filled) this.holes.delete(hole.first);
    return filled.filter((hole) => this.told.delete(hole)).map(({ problem }) => problem);
  }

  at(frame: number): Hole | null {
    for (const hole of this.holes.values()) {
      if (frame >= hole.first && frame < hole.first + hole.count) return hole;
    }
    return null;
  }

  /** What is wrong with the frame; null where nothing is, or where it was said before. */
  news(frame: number): string | null {
    const hole = this.at(frame);
    if (!hole || this.told.has(hole)) return null;
    this.told.add(hole);
    return hole.problem;
  }

  /** Goes on at the first frame that may come: past the end when playback loops. Stops if every frame left is damaged. */
  past(transport: Transport): Transport {
    let frame = Math.floor(transport.position);
    // Each hole is met once, and one of them a second time around the end.
    for (let left = this.holes.size + 1; left > 0; left--) {
      const hole = this.at(frame);
      if (!hole) return frame === Math.floor(transport.position) ? transport : { ...transport, position: frame };
      frame = transport.direction > 0 ? hole.first + hole.count : hole.first - 1;
      if (frame >= 0 && frame < transport.frames) continue;
      if (transport.repeat === 'once' || !transport.complete) break;
      frame = transport.direction > 0 ? 0 : transport.frames - 1;
    }
    return { ...transport, playing: false };
  }

  clear() {
    this.holes.clear();
    this.told.clear();
  }
}
