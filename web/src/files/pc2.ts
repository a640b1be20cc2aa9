/** Point caches `.pc2`, as 3ds Max and Blender write them: a header of 32 bytes, then single precision, frame by frame. */

import { ArrayFrames, type FrameSource, UnusableFile } from './frameSource';

const HEADER_BYTES = 32;

export async function pc2Frames(file: File): Promise<FrameSource> {
  const head = await file.slice(0, HEADER_BYTES).arrayBuffer();
  const magic = new TextDecoder('latin1').decode(head.slice(0, 12));
  if (head.byteLength < HEADER_BYTES || magic !== 'POINTCACHE2\0') {
    throw new UnusableFile(file.name, 'not a .pc2 point cache (version 2).');
  }
  const view = new DataView(head);
  const [points, frames] = [view.getInt32(16, true), view.getInt32(28, true)];
  if (points < 1 || frames < 1) throw new UnusableFile(file.name, 'it has no frames or no points.');
  if (file.size < HEADER_BYTES + frames * points * 12) {
    throw new UnusableFile(file.name, 'it is shorter than its header says; export it again.');
  }
  return new ArrayFrames(file, 'point cache', frames, points, { offset: HEADER_BYTES, width: 4, littleEndian: true });
}
