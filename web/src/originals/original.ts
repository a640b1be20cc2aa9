import type { Capture } from '../capture';
import { counted } from '../text';
import { classify, type Dropped } from '../files/classify';
import { framesOf } from '../files/frameFiles';
import type { FrameSource } from '../files/frameSource';
import { extensionOf } from '../files/meshes';

const KEPT_BYTES = 48 * 2 ** 20;

/** The frames that a capture was encoded from, read from files piece by piece when they are wanted. */
export class Original {
  /** Frames in memory, the one used last at the end. */
  private readonly kept = new Map<number, Float32Array>();
  private readonly loading = new Map<number, Promise<Float32Array>>();

  /** @param numbers which frame of the files each frame of the capture is; null where they are the same */
  constructor(
    readonly name: string,
    private readonly source: FrameSource,
    private readonly numbers: Float64Array | null,
  ) {}

  /** Positions of a frame of the capture, x y z of each point, if they are in memory. */
  peek(frame: number): Float32Array | null {
    const positions = this.kept.get(frame);
    if (!positions) return null;
    this.kept.delete(frame);
    this.kept.set(frame, positions);
    return positions;
  }

  /** Positions of a frame of the capture. Throws one sentence for a person where the files do not have it. */
  load(frame: number): Promise<Float32Array> {
    const here = this.peek(frame);
    if (here) return Promise.resolve(here);
    const running = this.loading.get(frame);
    if (running) return running;
    const loading = this.read(frame).finally(() => this.loading.delete(frame));
    this.loading.set(frame, loading);
    return loading;
  }

  /** Reads the first of these frames that is not in memory, unless something is being read. */
  prefetch(frames: Iterable<number>) {
    if (this.loading.size > 0) return;
    for (const frame of frames) {
      if (this.kept.has(frame)) continue;
      // A failure shows when the frame is looked at.
      this.load(frame).catch(() => undefined);
      return;
    }
  }

  private async read(frame: number): Promise<Float32Array> {
    const number = this.numbers ? this.numbers[frame] : frame;
    if (!(number < this.source.frames)) {
      throw new Error(
        `${this.name} has ${counted(this.source.frames, 'frame')}, and no frame ${number} to compare with.`,
      );
    }
    const positions = await this.source.read(number, 1);
    this.kept.set(frame, positions);
    const most = Math.max(4, Math.floor(KEPT_BYTES / positions.byteLength));
    for (const oldest of this.kept.keys()) {
      if (this.kept.size <= most) break;
      this.kept.delete(oldest);
    }
    return positions;
  }
}

/**
 * Opens the frames that a capture was encoded from.
 *
 * @throws Error with one sentence for a person where the files are no frames, or those of something else
 */
export async function openOriginal(
  files: readonly Dropped[],
  capture: Pick<Capture, 'static' | 'frames' | 'complete' | 'frameNumbers'>,
): Promise<Original> {
  const items = classify(files);
  const single = items.length === 1 && extensionOf(items[0].name) === 'obj' ? items[0] : undefined;
  const item = items.find(({ role }) => role === 'frames') ?? single;
  if (!item) {
    throw new Error(
      'No frames found: drop an array (.npy), a point cache (.pc2), or a folder with one .obj per frame.',
    );
  }
  if (capture.static.origin) {
    throw new Error(
      'The capture is too far from the origin to be compared with its frames here; `cager decode` gives its positions in double precision.',
    );
  }
  const source = await framesOf(item.files);
  const points = capture.static.rest.length / 3;
  if (source.points !== points) {
    throw new Error(
      `${item.name} has ${counted(source.points, 'point')} in each frame and the capture ${counted(points, 'point')}: drop the frames that it was encoded from.`,
    );
  }
  return new Original(item.name, source, numbersFor(source.frames, capture, item.name));
}

/** Which frame of the files each frame of the capture is. Files may have just the frames of the capture, or all frames that it numbers. */
function numbersFor(
  frames: number,
  { frames: known, complete, frameNumbers }: Pick<Capture, 'frames' | 'complete' | 'frameNumbers'>,
  name: string,
): Float64Array | null {
  if (frames === known) return null;
  if (frameNumbers?.every((number) => Number.isSafeInteger(number) && number >= 0 && number < frames))
    return frameNumbers;
  // Frames of a session that is running are still to come.
  if (!complete && frames > known) return null;
  throw new Error(
    `${name} has ${counted(frames, 'frame')} and the capture ${counted(known, 'frame')}: drop the frames that it was encoded from, all of them and no others.`,
  );
}
