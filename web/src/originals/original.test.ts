import { expect, test } from 'vitest';
import { openOriginal } from './original';
import { pointErrors } from './pointErrors';
import { pointAt } from '../viewer/pointMarks';

/** A point cache whose frame f has point p at (f, p, 0). */
function pointCache(frames: number, points: number, name = 'walk.pc2'): File {
  const view = new DataView(new ArrayBuffer(32));
  new TextEncoder().encodeInto('POINTCACHE2', new Uint8Array(view.buffer));
  view.setInt32(12, 1, true);
  view.setInt32(16, points, true);
  view.setFloat32(24, 1, true);
  view.setInt32(28, frames, true);
  const values = new Float32Array(frames * points * 3);
  for (let k = 0; k < frames * points; k++) values.set([Math.floor(k / points), k % points, 0], 3 * k);
  return new File([view.buffer, values], name);
}

function dropped(...files: File[]) {
  return files.map((file) => ({ file, path: file.name }));
}

function capture(frames: number, points: number, more: { complete?: boolean; frameNumbers?: Float64Array } = {}) {
  const part = { rest: new Float64Array(3 * points) } as never;
  return { static: part, frames, complete: true, frameNumbers: null, ...more };
}

test('frames_are_read_when_they_are_wanted_and_kept', async () => {
  const original = await openOriginal(dropped(pointCache(5, 4)), capture(5, 4));
  expect(original.peek(3)).toBeNull();
  expect([...(await original.load(3)).subarray(0, 6)]).toEqual([3, 0, 0, 3, 1, 0]);
  expect(original.peek(3)).not.toBeNull();
  await expect(original.load(5)).rejects.toThrow('walk.pc2 has 5 frames, and no frame 5');
});

test('frames_that_do_not_fit_the_capture_are_refused_in_words', async () => {
  await expect(openOriginal(dropped(pointCache(5, 4)), capture(5, 7))).rejects.toThrow(
    'walk.pc2 has 4 points in each frame and the capture 7 points',
  );
  await expect(openOriginal(dropped(pointCache(5, 4)), capture(6, 4))).rejects.toThrow(
    'walk.pc2 has 5 frames and the capture 6 frames',
  );
  await expect(openOriginal(dropped(new File(['x'], 'notes.txt')), capture(6, 4))).rejects.toThrow('No frames found');
});

test('frames_of_a_capture_that_numbers_them_are_found_by_number', async () => {
  const frameNumbers = Float64Array.of(4, 2);
  const original = await openOriginal(dropped(pointCache(5, 4)), capture(2, 4, { frameNumbers }));
  expect((await original.load(0))[0]).toBe(4);
  expect((await original.load(1))[0]).toBe(2);
});

test('a_session_that_is_running_may_have_fewer_frames_than_its_original', async () => {
  const original = await openOriginal(dropped(pointCache(5, 4)), capture(2, 4, { complete: false }));
  expect((await original.load(4))[0]).toBe(4);
});

test('a_single_mesh_is_the_original_of_a_capture_of_one_frame', async () => {
  const mesh = new File(['v 1 2 3\nv 4 5 6\n'], 'pose.obj');
  const original = await openOriginal(dropped(mesh), capture(1, 2));
  expect([...(await original.load(0))]).toEqual([1, 2, 3, 4, 5, 6]);
});

test('errors_are_distances_as_fractions_of_the_diagonal', () => {
  const decoded = Float32Array.of(0, 0, 0, 3, 4, 0, 1, 1, 1);
  const original = Float32Array.of(0, 0, 1, 0, 0, 0, NaN, 1, 1);
  const { values, worst, largest, l2 } = pointErrors(decoded, original, 10);
  expect(values[0]).toBeCloseTo(0.1, 6);
  expect(values[1]).toBeCloseTo(0.5, 6);
  expect(values[2]).toBeNaN();
  expect([worst, largest]).toEqual([1, 0.5]);
  // The point that has no position does not count.
  expect(l2).toBeCloseTo(Math.sqrt((0.01 + 0.25) / 2), 9);
});

test('what_is_usual_passes_over_a_few_points_that_are_far_away', () => {
  const decoded = new Float32Array(3 * 1000);
  for (let point = 0; point < 1000; point++) decoded[3 * point] = point < 5 ? 8 : point / 1000;
  const { usual, largest } = pointErrors(decoded, new Float32Array(3000), 1);
  expect(largest).toBe(8);
  expect(usual).toBeGreaterThan(0.99);
  expect(usual).toBeLessThan(1.01);
});

test('the_nearest_of_the_points_under_the_pointer_is_found', () => {
  // An eye at the origin that looks along −z: w = −z.
  const matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, -1, 0, 0, 0, 0];
  const picture = { matrix, width: 200, height: 100 };
  const positions = [0, 0, -4, 0, 0, -2, 1, 0, -2, 0, 0, 3];
  expect(pointAt(positions, { x: 103, y: 50 }, picture, 8)).toBe(1);
  expect(pointAt(positions, { x: 30, y: 50 }, picture, 8)).toBeNull();
});
