/** What can be said of mesh files without sending them: their points, and those of `.obj` files themselves. */

import { type FrameSource, readPart, UnusableFile } from './frameSource';

const HEAD_BYTES = 1 << 16;

/** Number of points of a mesh file; null for formats whose points the service alone counts (welded or merged ones). */
export async function pointsOf(file: File): Promise<number | null> {
  const extension = extensionOf(file.name);
  if (extension === 'obj') return (await objPoints(file)).length / 3;
  if (extension === 'ply') {
    const head = new TextDecoder('latin1').decode(await file.slice(0, HEAD_BYTES).arrayBuffer());
    const found = /^element vertex (\d+)/m.exec(head);
    if (!head.startsWith('ply') || !found) throw new UnusableFile(file.name, 'not a PLY file.');
    return Number(found[1]);
  }
  if (extension === 'off') {
    const head = await file.slice(0, HEAD_BYTES).text();
    const found = /^\s*(?:[A-Z]*OFF)?\s*(?:#.*\s+)*(\d+)\s+\d+/.exec(head);
    if (!found) throw new UnusableFile(file.name, 'not an OFF file.');
    return Number(found[1]);
  }
  return null;
}

/** Whether a `.glb` file moves. */
export async function isAnimated(file: File): Promise<boolean> {
  if (extensionOf(file.name) !== 'glb') return false;
  const length = new DataView(await file.slice(0, 20).arrayBuffer()).getUint32(12, true);
  const head = JSON.parse(await file.slice(20, 20 + length).text()) as { animations?: unknown[] };
  return (head.animations?.length ?? 0) > 0;
}

/** Positions of the `v` lines of a Wavefront file, x y z each. */
export async function objPoints(file: File): Promise<Float32Array> {
  const text = new TextDecoder().decode(await readPart(file, 0, file.size));
  const values: number[] = [];
  for (let at = 0; at < text.length;) {
    const found = text.indexOf('\n', at);
    const end = found < 0 ? text.length : found;
    const line = text.slice(at, end).trimStart();
    if (line.startsWith('v ') || line.startsWith('v\t')) {
      const [x, y, z] = line.slice(2).trim().split(/\s+/, 3).map(Number);
      if (!Number.isFinite(x) || !Number.isFinite(y) || !Number.isFinite(z))
        throw new UnusableFile(file.name, `point ${values.length / 3} is “${line.trim()}”, which is not a position.`);
      values.push(x, y, z);
    }
    at = end + 1;
  }
  if (values.length === 0) throw new UnusableFile(file.name, 'it has no points.');
  return Float32Array.from(values);
}

export class ObjFrames implements FrameSource {
  readonly frames: number;
  readonly description: string;

  private constructor(
    private readonly files: readonly File[],
    readonly points: number,
  ) {
    this.frames = files.length;
    this.description = `${files[0].name} to ${files[files.length - 1].name}`;
  }

  static async of(files: readonly File[]): Promise<ObjFrames> {
    return new ObjFrames(files, (await objPoints(files[0])).length / 3);
  }

  async read(first: number, count: number): Promise<Float32Array> {
    const values = new Float32Array(count * 3 * this.points);
    for (let k = 0; k < count; k += 1) {
      const file = this.files[first + k];
      const points = await objPoints(file);
      if (points.length !== 3 * this.points) {
        const what = `it has ${points.length / 3} points and the frames before it ${this.points}; all frames must be the same mesh.`;
        throw new UnusableFile(file.name, what);
      }
      values.set(points, k * 3 * this.points);
    }
    return values;
  }
}

export function extensionOf(name: string): string {
  return /\.([^./\\]+)$/.exec(name)?.[1].toLowerCase() ?? '';
}
