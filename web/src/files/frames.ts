import { type FrameSource, UnusableFile } from './frameSource';
import { mddFrames } from './mdd';
import { extensionOf, ObjFrames } from './meshes';
import { npyFrames } from './npy';
import { pc2Frames } from './pc2';

/** Frames of an array, a point cache, or of `.obj` files in this order. */
export async function framesOf(files: readonly File[]): Promise<FrameSource> {
  const extension = extensionOf(files[0].name);
  if (files.length > 1 || extension === 'obj') return ObjFrames.of(files);
  const read = { npy: npyFrames, pc2: pc2Frames, mdd: mddFrames }[extension];
  if (!read) throw new UnusableFile(files[0].name, 'frames must be .npy, .pc2, .mdd or .obj files.');
  return read(files[0]);
}
