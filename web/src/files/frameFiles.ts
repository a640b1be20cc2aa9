import { ArrayFrames, type FrameSource, UnusableFile } from './frameSource';
import { extensionOf, ObjFrames } from './meshes';

const MAGIC = [0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59];
/** Longest header that is read; NumPy pads them to some hundred bytes. */
const MAX_HEADER_BYTES = 1 << 16;

/** Frames of an array of F × n × 3 numbers in f32 or f64. */
export async function npyFrames(file: File): Promise<FrameSource> {
  const head = new Uint8Array(await file.slice(0, MAX_HEADER_BYTES).arrayBuffer());
  const text = new TextDecoder('latin1').decode(head);
  if (head.length < 12 || !MAGIC.every((byte, k) => head[k] === byte))
    throw new UnusableFile(file.name, 'not a NumPy file.');
  const view = new DataView(head.buffer);
  // Version 1 has a length of two bytes, later ones of four.
  const begin = head[6] === 1 ? 10 : 12;
  const length = head[6] === 1 ? view.getUint16(8, true) : view.getUint32(8, true);
  if (begin + length > head.length) throw new UnusableFile(file.name, 'its header is damaged; save the array again.');
  const header = text.slice(begin, begin + length);

  const type = /'descr'\s*:\s*'([^']*)'/.exec(header)?.[1] ?? 'unknown';
  const number = /^([<>=|]?)f([48])$/.exec(type);
  if (!number)
    throw new UnusableFile(file.name, `its data type is ${type}; save it as float32: array.astype("float32").`);
  if (/'fortran_order'\s*:\s*True/.test(header)) {
    const what = 'it is stored column by column (Fortran order); save numpy.ascontiguousarray(array) instead.';
    throw new UnusableFile(file.name, what);
  }
  const shape = (/'shape'\s*:\s*\(([^)]*)\)/.exec(header)?.[1] ?? '').split(',').filter((part) => part.trim() !== '');
  const [frames, points, axes] = shape.map(Number);
  if (shape.length !== 3 || axes !== 3 || !(frames > 0) || !(points > 0)) {
    const what = `its shape is (${shape.map((part) => part.trim()).join(', ')}); expected (frames, points, 3).`;
    throw new UnusableFile(file.name, what);
  }
  const width = number[2] === '8' ? 8 : 4;
  const offset = begin + length;
  if (file.size < offset + frames * points * 3 * width)
    throw new UnusableFile(file.name, 'it is shorter than its header says; copy it again.');
  const description = `NumPy array, ${width === 8 ? 'double' : 'single'} precision`;
  return new ArrayFrames(file, description, frames, points, { offset, width, littleEndian: number[1] !== '>' });
}

const HEADER_BYTES = 32;

export async function pc2Frames(file: File): Promise<FrameSource> {
  const head = await file.slice(0, HEADER_BYTES).arrayBuffer();
  const magic = new TextDecoder('latin1').decode(head.slice(0, 12));
  if (head.byteLength < HEADER_BYTES || magic !== 'POINTCACHE2\0')
    throw new UnusableFile(file.name, 'not a .pc2 point cache (version 2).');
  const view = new DataView(head);
  const [points, frames] = [view.getInt32(16, true), view.getInt32(28, true)];
  if (points < 1 || frames < 1) throw new UnusableFile(file.name, 'it has no frames or no points.');
  if (file.size < HEADER_BYTES + frames * points * 12)
    throw new UnusableFile(file.name, 'it is shorter than its header says; export it again.');
  return new ArrayFrames(file, 'point cache', frames, points, { offset: HEADER_BYTES, width: 4, littleEndian: true });
}

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

/** Frames of an array, a point cache, or of `.obj` files in this order. */
export async function framesOf(files: readonly File[]): Promise<FrameSource> {
  const extension = extensionOf(files[0].name);
  if (files.length > 1 || extension === 'obj') return ObjFrames.of(files);
  const read = { npy: npyFrames, pc2: pc2Frames, mdd: mddFrames }[extension];
  if (!read) throw new UnusableFile(files[0].name, 'frames must be .npy, .pc2, .mdd or .obj files.');
  return read(files[0]);
}
