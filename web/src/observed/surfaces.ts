import type { Capture } from '../capture';
import { moduleWorker } from '../moduleWorker';
import { counted } from '../text';
import { classify, type Dropped } from '../files/classify';
import { extensionOf, pointsOf } from '../files/meshes';
import type { Surface } from './surface';
import workerAddress from './worker.ts?worker&url';

export interface Asked {
  readonly frame: number;
  readonly file: File;
  /** Points of the template in this frame, x y z each. */
  readonly places: Float32Array;
}

/** A frame's surface, and how far each point of the template is from it. */
export interface Observed {
  readonly surface: Surface;
  readonly distances: Float32Array;
}

export type Answer = Observed | { readonly problem: string };

/** The surfaces that a capture was recovered from, a file each, read in a worker when they are wanted. */
export class ObservedSurfaces {
  private failure: Error | null = null;
  private fail: (error: Error) => void = () => undefined;
  private readonly worker = moduleWorker(workerAddress, (error) => {
    this.failure = error;
    this.fail(error);
  });
  private last: Promise<unknown> = Promise.resolve();

  /** @param files of each frame of the capture; undefined where there is none */
  constructor(
    readonly name: string,
    private readonly files: readonly (File | undefined)[],
  ) {}

  /** The surface of a frame, and how far places are from it. Throws one sentence for a person where its file cannot be read. */
  measure(frame: number, places: Float32Array): Promise<Observed> {
    // One after another: what is asked for next is what is shown then.
    const found = this.last.then(() => this.ask(frame, places));
    this.last = found.catch(() => undefined);
    return found;
  }

  close() {
    this.worker.terminate();
  }

  private ask(frame: number, places: Float32Array): Promise<Observed> {
    const file = this.files[frame];
    if (!file) {
      const nothing = { points: new Float32Array(0), triangles: new Uint32Array(0) };
      return Promise.resolve({ surface: nothing, distances: new Float32Array(places.length / 3).fill(NaN) });
    }
    return new Promise((resolve, reject) => {
      this.worker.onmessage = ({ data }: MessageEvent<Answer>) => {
        if ('problem' in data) reject(new Error(data.problem));
        else resolve(data);
      };
      this.fail = reject;
      if (this.failure) reject(this.failure);
      this.worker.postMessage({ frame, file, places } satisfies Asked);
    });
  }
}

/**
 * The surfaces that a capture was recovered from; null where the files are no meshes of other points than the capture's. Throws one sentence for a person
 * where there is none for some frames.
 */
export async function openSurfaces(
  dropped: readonly Dropped[],
  { static: { rest, origin }, frames, tracking }: Pick<Capture, 'static' | 'frames' | 'tracking'>,
): Promise<ObservedSurfaces | null> {
  const files = classify(dropped)
    .flatMap((item) => item.files)
    .filter(({ name }) => /^(obj|ply)$/.test(extensionOf(name)));
  if (files.length === 0 || files.length < dropped.length / 2) return null;
  const ends = await Promise.all([files[0], files.at(-1)!].map(pointsOf));
  const isPly = files.some(({ name }) => extensionOf(name) === 'ply');
  if (!tracking && !isPly && ends.every((points) => points === rest.length / 3)) return null;
  if (origin) {
    throw new Error(
      'The capture is too far from the origin to be compared with its surfaces here; the report of `cager recover` has the distances.',
    );
  }
  const named = new Map(files.map((file) => [file.name, file]));
  const byName = tracking?.files.map((name) => named.get(name));
  const matched = byName?.some(Boolean) ? byName : files;
  if (matched.length !== frames) {
    throw new Error(
      `There are ${counted(files.length, 'surface')} and the capture has ${counted(frames, 'frame')}: drop the files that it was recovered from, one per frame.`,
    );
  }
  return new ObservedSurfaces(`${files[0].name} …`, matched);
}
