import { describe, expect, it, test } from 'vitest';
import { ObjFrames, pointsOf } from '../files/meshes';
import { framesOf, mddFrames, npyFrames, pc2Frames } from '../files/frameFiles';
import { checkReadable } from '../files/frameSource';
import { planOf } from './plan';
import { classify } from '../files/classify';

const NUMBERS = Array.from({ length: 2 * 4 * 3 }, (_, i) => i / 8);

function npy(header: string, data: ArrayBuffer, version = 1): File {
  const text = `${header}\n`;
  const head = new Uint8Array([
    0x93,
    0x4e,
    0x55,
    0x4d,
    0x50,
    0x59,
    version,
    0,
    ...new Uint8Array(version === 1 ? 2 : 4),
  ]);
  const view = new DataView(head.buffer);
  if (version === 1) view.setUint16(8, text.length, true);
  else view.setUint32(8, text.length, true);
  return new File([head, text, data], 'walk.npy');
}

function header(descr: string, fortran = 'False', shape = '(2, 4, 3)'): string {
  return `{'descr': '${descr}', 'fortran_order': ${fortran}, 'shape': ${shape}, }`;
}

function bigEndian(values: readonly number[]): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(4 * values.length));
  values.forEach((value, i) => view.setFloat32(4 * i, value, false));
  return view.buffer;
}

test('arrays_of_either_precision_and_byte_order_give_the_same_frames', async () => {
  const files = [
    npy(header('<f4'), Float32Array.from(NUMBERS).buffer),
    npy(header('<f8'), Float64Array.from(NUMBERS).buffer),
    npy(header('>f4'), bigEndian(NUMBERS)),
    npy(header('<f4'), Float32Array.from(NUMBERS).buffer, 2),
  ];
  for (const file of files) {
    const frames = await npyFrames(file);
    expect([frames.frames, frames.points]).toEqual([2, 4]);
    expect([...(await frames.read(0, 2))]).toEqual(NUMBERS);
    expect([...(await frames.read(1, 1))]).toEqual(NUMBERS.slice(12));
  }
});

test('arrays_that_are_something_else_say_what_to_save', async () => {
  const data = Float32Array.from(NUMBERS).buffer;
  await expect(npyFrames(npy(header('<f4', 'True'), data))).rejects.toThrow('ascontiguousarray');
  await expect(npyFrames(npy(header('<i8'), data))).rejects.toThrow('astype');
  await expect(npyFrames(npy(header('<f4', 'False', '(8, 3)'), data))).rejects.toThrow('(frames, points, 3)');
  await expect(npyFrames(npy(header('<f4', 'False', '(9, 4, 3)'), data))).rejects.toThrow('shorter');
  await expect(npyFrames(new File(['PK\x03\x04'], 'walk.npz'))).rejects.toThrow('not a NumPy file');
});

test('a_point_cache_is_read_behind_its_header', async () => {
  const head = new DataView(new ArrayBuffer(32));
  new TextEncoder().encode('POINTCACHE2').forEach((byte, i) => head.setUint8(i, byte));
  [1, 4].forEach((value, i) => head.setInt32(12 + 4 * i, value, true));
  head.setInt32(28, 2, true);
  const frames = await pc2Frames(new File([head.buffer, Float32Array.from(NUMBERS)], 'walk.pc2'));
  expect([frames.frames, frames.points]).toEqual([2, 4]);
  expect([...(await frames.read(1, 1))]).toEqual(NUMBERS.slice(12));
  await expect(pc2Frames(new File([head.buffer], 'walk.pc2'))).rejects.toThrow('shorter');
});

test('a_motion_designer_cache_is_read_behind_its_times_and_told_by_its_length', async () => {
  const counts = new DataView(new ArrayBuffer(8));
  [2, 4].forEach((value, i) => counts.setInt32(4 * i, value, false));
  const parts = [counts.buffer, bigEndian([0, 1 / 24]), bigEndian(NUMBERS)];
  const frames = await mddFrames(new File(parts, 'walk.mdd'));
  expect([frames.frames, frames.points]).toEqual([2, 4]);
  expect([...(await frames.read(0, 2))]).toEqual(NUMBERS);
  expect([...(await frames.read(1, 1))]).toEqual(NUMBERS.slice(12));
  await expect(mddFrames(new File(parts.slice(0, 2), 'walk.mdd'))).rejects.toThrow('its size does not match');
  await expect(mddFrames(new File([...parts, new Uint8Array(4)], 'walk.mdd'))).rejects.toThrow('export it again');
  await expect(mddFrames(new File([new Uint8Array(8)], 'walk.mdd'))).rejects.toThrow('no frames');
  await expect(mddFrames(new File([new Uint8Array(5)], 'walk.mdd'))).rejects.toThrow('the header is incomplete');
  counts.setInt32(0, 0x7fffffff, false);
  await expect(mddFrames(new File(parts, 'walk.mdd'))).rejects.toThrow('2147483647 frames');
});

test('meshes_are_counted_and_read', async () => {
  const obj = (x: number): File =>
    new File([`# a\nv ${x} 2 3\r\nvn 0 0 1\n  v 4 5 6 0.5 0.5 0.5\nf 1 2 1`], `${x}.obj`);
  const frames = await ObjFrames.of([obj(1), obj(7)]);
  expect([...(await frames.read(0, 2))]).toEqual([1, 2, 3, 4, 5, 6, 7, 2, 3, 4, 5, 6]);
  expect(await pointsOf(obj(1))).toBe(2);
  expect(await pointsOf(new File(['ply\nformat ascii 1.0\nelement vertex 17\n'], 'a.ply'))).toBe(17);
  expect(await pointsOf(new File(['OFF\n# made by hand\n12 20 0\n'], 'a.off'))).toBe(12);
  expect(await pointsOf(new File([new Uint8Array(84)], 'a.stl'))).toBeNull();
  await expect(ObjFrames.of([new File(['v 1 nan 2'], 'a.obj')])).rejects.toThrow('not a position');
  const uneven = await ObjFrames.of([obj(1), new File(['v 0 0 0'], '2.obj')]);
  await expect(uneven.read(0, 2)).rejects.toThrow('2.obj: it has 1 points');
});

test('a_plan_names_what_is_missing', async () => {
  const file = (name: string, content: string) => ({ path: name, file: new File([content], name) });
  const array = { path: 'walk.npy', file: npy(header('<f4'), Float32Array.from(NUMBERS).buffer) };
  await expect(planOf(classify([array]))).rejects.toThrow('rest pose is missing');
  await expect(planOf(classify([file('rest.obj', 'v 0 0 0')]))).rejects.toThrow('Frames are missing');
  await expect(planOf(classify([array, file('rest.obj', 'v 0 0 0')]))).rejects.toThrow('4 points in each frame');
  const plan = await planOf(classify([array, file('rest.obj', 'v 0 0 0\n'.repeat(4))]));
  expect(plan.cage).toBeNull();
});

describe('a file that is no longer what was added', () => {
  it.each([
    ['cannot be read', () => Promise.reject(new DOMException('It could not be read.', 'NotReadableError'))],
    ['is shorter', () => Promise.resolve(new ArrayBuffer(4))],
  ])('%s, and is named', async (_, arrayBuffer) => {
    const file = new File(['v 0 0 0\nv 1 1 1\n'], 'frame_7.obj');
    file.slice = () => ({ arrayBuffer }) as unknown as Blob;
    const sentence = 'frame_7.obj: it changed or was removed after it was added. Add it again.';
    await expect(framesOf([file])).rejects.toThrow(sentence);
    await expect(checkReadable([null, file])).rejects.toThrow(sentence);
  });
});
