/** Motion Designer's `.mdd`: frames, points, a time for each frame, then single precision frame by frame; all big-endian. */

import { ArrayFrames, type FrameSource, UnusableFile } from './frameSource';

const COUNTS_BYTES = 8;

export async function mddFrames(file: File): Promise<FrameSource> {
  const head = await file.slice(0, COUNTS_BYTES).arrayBuffer();
  if (head.byteLength < COUNTS_BYTES) throw new UnusableFile(file.name, 'the header is incomplete; export it again.');
  const view = new DataView(head);
  const [frames, points] = [view.getInt32(0, false), view.getInt32(4, false)];
  if (frames < 1 || points < 1)
    throw new UnusableFile(file.name, 'it has no frames or no points, or is not an .mdd file.');
  const offset = COUNTS_BYTES + 4 * frames;
  const expected = offset + frames * points * 12;
  // Nothing but its length tells such a file from others.
  if (file.size !== expected) {
    const what = `its size does not match ${frames} frames of ${points} points; export it again.`;
    throw new UnusableFile(file.name, what);
  }
  return new ArrayFrames(file, 'Motion Designer cache', frames, points, { offset, width: 4, littleEndian: false });
}
