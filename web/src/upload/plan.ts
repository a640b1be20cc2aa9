/** What will be sent, checked as far as that goes before anything is. */

import { counted } from '../sessions/text';
import type { Item } from './classify';
import { type FrameSource, UnusableFile } from './frameSource';
import { ObjFrames, extensionOf, pointsOf } from './meshes';
import { mddFrames } from './mdd';
import { npyFrames } from './npy';
import { pc2Frames } from './pc2';

/** A capture that can be sent. */
export interface Plan {
  readonly rest: File;
  /** Without one the service makes it. */
  readonly cage: File | null;
  readonly frames: FrameSource;
  /** What to know of it, sentences. */
  readonly remarks: readonly string[];
}

/**
 * Makes a plan of the items' roles.
 *
 * @throws Error whose message says what is missing or does not fit
 */
export async function planOf(items: readonly Item[]): Promise<Plan> {
  const having = (role: Item['role']) => items.find((item) => item.role === role);
  const [framesItem, cageItem] = [having('frames'), having('cage')];
  if (!framesItem) {
    throw new Error(
      'Frames are missing: drop an array (.npy), a point cache (.pc2 or .mdd), or a folder with one .obj per frame.',
    );
  }
  const frames = await framesOf(framesItem.files);
  const restItem = having('rest');
  if (!restItem && framesItem.files.length < 2) {
    throw new Error('The rest pose is missing: drop the mesh that moves, as .obj, .ply, .off, .stl or .glb.');
  }
  const rest = (restItem ?? framesItem).files[0];
  const remarks = restItem ? [] : [`The first frame, ${rest.name}, is taken as the rest pose.`];
  const points = await pointsOf(rest);
  if (points !== null && points !== frames.points) {
    throw new Error(
      `${framesItem.name} has ${counted(frames.points, 'point')} in each frame and the rest pose ${rest.name} has ${counted(points, 'point')}: both have to be the same mesh, with its points in the same order.`,
    );
  }
  return { rest, cage: cageItem?.files[0] ?? null, frames, remarks };
}

/** Frames of an array, a point cache, or of `.obj` files in this order. */
export async function framesOf(files: readonly File[]): Promise<FrameSource> {
  const extension = extensionOf(files[0].name);
  if (files.length > 1 || extension === 'obj') return ObjFrames.of(files);
  const read = { npy: npyFrames, pc2: pc2Frames, mdd: mddFrames }[extension];
  if (!read) throw new UnusableFile(files[0].name, 'frames are .npy, .pc2, .mdd or .obj files.');
  return read(files[0]);
}
