import type { Capture } from '../capture';
import type { FrameData, FrameStore } from '../render/frameStore';
import { Holes } from './holes';
import { sentence } from '../text';
import { framesAhead, framesAround, type Transport } from './transport';

/** Frames that are loaded ahead of the one that is shown. */
const AHEAD = 24;

/** What is drawn at a place: a frame, and how much the one after it counts. */
export interface Blend {
  readonly before: number;
  readonly mix: number;
  readonly here: FrameData;
  /** Null where one frame stands alone. */
  readonly there: FrameData | null;
}

/** Frames of a capture for whoever plays it: loads them ahead and leaves out those that do not come. */
export class FrameFeed {
  /** Frames that could not be loaded: they are not asked for again until somebody plays or seeks. */
  readonly holes = new Holes();
  private isClosed = false;

  /** @param onFailure called when frames did not come */
  constructor(
    private readonly capture: Capture,
    private readonly store: FrameStore,
    private readonly onFailure: () => void,
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

  /** Loads the frames that will be shown soon. */
  prefetch(transport: Transport) {
    this.store.prefetch([...framesAhead(transport, AHEAD)].filter((frame) => !this.holes.at(frame)));
  }

  load(frame: number) {
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

  close() {
    this.isClosed = true;
    this.store.close();
  }

  private fail(frame: number, error: unknown) {
    if (this.isClosed) return;
    const { first, count } = this.capture.readTogether?.(frame) ?? { first: frame, count: 1 };
    this.holes.add({ first, count, problem: sentence(error) });
    this.onFailure();
  }

  /** Frames to blend; the one before a hole stands until it is over. */
  private soundFramesAround(transport: Transport): ReturnType<typeof framesAround> {
    const frames = framesAround(transport);
    return frames.mix > 0 && this.holes.at(frames.after) ? { ...frames, after: frames.before, mix: 0 } : frames;
  }
}

/** Rows of a cage between two frames. */
export function blendedRows({ here, there, mix }: Blend): Float32Array | Float64Array {
  if (!there) return here.rows;
  const rows = new Float64Array(here.rows.length);
  for (let k = 0; k < rows.length; k++) rows[k] = here.rows[k] + (there.rows[k] - here.rows[k]) * mix;
  return rows;
}
