/** Frames of a capture as they lie in files that were dropped on the page: read piece by piece, never all at once. */

/** A file that is no capture this page can send. `message` says what is wrong with it and what to do. */
export class UnusableFile extends Error {
  override readonly name = 'UnusableFile';

  constructor(file: string, what: string) {
    super(`${file}: ${what}`);
  }
}

export interface FrameSource {
  readonly frames: number;
  readonly points: number;
  /** What it is and how much of it, for people. */
  readonly description: string;
  /** Positions of `count` frames from `first` on, `count × points × 3`. */
  read(first: number, count: number): Promise<Float32Array>;
}

/** Raw numbers that lie in a file frame by frame. */
export class ArrayFrames implements FrameSource {
  constructor(
    private readonly file: Blob,
    readonly description: string,
    readonly frames: number,
    readonly points: number,
    private readonly layout: { readonly offset: number; readonly width: 4 | 8; readonly littleEndian: boolean },
  ) {}

  async read(first: number, count: number): Promise<Float32Array> {
    const { offset, width, littleEndian } = this.layout;
    const stride = 3 * this.points * width;
    const begin = offset + first * stride;
    const bytes = await this.file.slice(begin, begin + count * stride).arrayBuffer();
    if (bytes.byteLength !== count * stride) throw new Error('The file changed after it was added. Add it again.');
    if (littleEndian) return width === 4 ? new Float32Array(bytes) : Float32Array.from(new Float64Array(bytes));
    const view = new DataView(bytes);
    const values = new Float32Array(count * 3 * this.points);
    for (let i = 0; i < values.length; i += 1) {
      values[i] = width === 4 ? view.getFloat32(4 * i, false) : view.getFloat64(8 * i, false);
    }
    return values;
  }
}
