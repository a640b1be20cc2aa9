/** Frames of a capture as they lie in files that were dropped on the page: read piece by piece, never all at once. */

/** What is said of a file that cannot be read to its end, behind its name. */
export const CHANGED_FILE = 'changed or was removed after it was added. Add it again.';

/** A file that is no capture this page can send. `message` says what is wrong with it and what to do. */
export class UnusableFile extends Error {
  override readonly name = 'UnusableFile';

  constructor(file: string, what: string) {
    super(`${file}: ${what}`);
  }
}

/**
 * The bytes of a part of a file.
 *
 * @throws UnusableFile where it is no longer what was added
 */
export async function readPart(file: File, begin: number, end: number): Promise<ArrayBuffer> {
  const bytes = await file
    .slice(begin, end)
    .arrayBuffer()
    .catch(() => null);
  if (bytes?.byteLength !== end - begin) throw new UnusableFile(file.name, `it ${CHANGED_FILE}`);
  return bytes;
}

/** Checks that files are what was added: a request that sends others fails as one without a network. */
export async function checkReadable(files: readonly (File | null)[]): Promise<void> {
  for (const file of files) if (file) await readPart(file, 0, Math.min(1, file.size));
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
    private readonly file: File,
    readonly description: string,
    readonly frames: number,
    readonly points: number,
    private readonly layout: { readonly offset: number; readonly width: 4 | 8; readonly littleEndian: boolean },
  ) {}

  async read(first: number, count: number): Promise<Float32Array> {
    const { offset, width, littleEndian } = this.layout;
    const stride = 3 * this.points * width;
    const begin = offset + first * stride;
    const bytes = await readPart(this.file, begin, begin + count * stride);
    if (littleEndian) return width === 4 ? new Float32Array(bytes) : Float32Array.from(new Float64Array(bytes));
    const view = new DataView(bytes);
    const values = new Float32Array(count * 3 * this.points);
    for (let i = 0; i < values.length; i += 1) {
      values[i] = width === 4 ? view.getFloat32(4 * i, false) : view.getFloat64(8 * i, false);
    }
    return values;
  }
}
