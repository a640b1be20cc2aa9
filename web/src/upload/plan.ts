/** What will be sent, checked as far as that goes before anything is. */

import { counted } from '../text';
import { encodeElsewhere, type Item } from '../files/classify';
import { framesOf } from '../files/frameFiles';
import type { FrameSource } from '../files/frameSource';
import { isAnimated, pointsOf } from '../files/meshes';

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
  const restItem = having('rest');
  if (!framesItem) {
    // What is no such file after all is for the service to refuse.
    if (restItem && (await isAnimated(restItem.files[0]).catch(() => false)))
      throw new Error(`${restItem.name} is animated. ${encodeElsewhere()}`);
    throw new Error(
      'Frames are missing: add an array (.npy), a point cache (.pc2 or .mdd), or a folder with one .obj per frame.',
    );
  }
  const frames = await framesOf(framesItem.files);
  if (!restItem && framesItem.files.length < 2)
    throw new Error('The rest pose is missing: add the undeformed mesh as .obj, .ply, .off, .stl or .glb.');
  const rest = (restItem ?? framesItem).files[0];
  const remarks = restItem ? [] : [`The first frame, ${rest.name}, is used as the rest pose.`];
  const points = await pointsOf(rest);
  if (points !== null && points !== frames.points) {
    throw new Error(
      `${framesItem.name} has ${counted(frames.points, 'point')} in each frame and the rest pose ${rest.name} has ${counted(points, 'point')}: they must be the same mesh, with points in the same order.`,
    );
  }
  return { rest, cage: cageItem?.files[0] ?? null, frames, remarks };
}
