/** NumPy's `.npy` files: a header in the syntax of a Python dictionary, then the array (NEP 1). */

import { ArrayFrames, type FrameSource, UnusableFile } from './frameSource';

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
  if (!number) {
    throw new UnusableFile(file.name, `its data type is ${type}; save it as float32: array.astype("float32").`);
  }
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
  if (file.size < offset + frames * points * 3 * width) {
    throw new UnusableFile(file.name, 'it is shorter than its header says; copy it again.');
  }
  const description = `NumPy array, ${width === 8 ? 'double' : 'single'} precision`;
  return new ArrayFrames(file, description, frames, points, { offset, width, littleEndian: number[1] !== '>' });
}
