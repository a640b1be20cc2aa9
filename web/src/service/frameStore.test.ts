import { expect, test } from 'vitest';
import { FrameStore, GrowingErrors } from './frameStore';

const rows = (value: number): Float32Array => new Float32Array(6).fill(value);

test('a_block_has_the_frames_around_without_a_gap', () => {
  const store = new FrameStore(2);
  [0, 1, 3, 4, 63, 64].forEach((frame) => store.put(frame, rows(frame)));
  expect(store.block(2)).toBeNull();
  const block = store.block(4)!;
  expect([block.first, block.count]).toEqual([3, 2]);
  expect([...block.cages]).toEqual([...rows(3), ...rows(4)]);
  // Chunks have 64 frames.
  expect(store.block(63)).toMatchObject({ first: 63, count: 1 });
  expect(store.block(64)).toMatchObject({ first: 64, count: 1 });
});

test('memory_is_bounded_and_what_was_used_last_stays', () => {
  const chunkBytes = 64 * 24;
  const store = new FrameStore(2, 3 * chunkBytes);
  [0, 64, 128].forEach((frame) => store.put(frame, rows(frame)));
  expect(store.block(0)).not.toBeNull();
  store.put(192, rows(192));
  expect([0, 64, 128, 192].map((frame) => store.block(frame) !== null)).toEqual([true, false, true, true]);
});

test('a_block_that_was_handed_out_does_not_change', () => {
  const store = new FrameStore(2);
  store.put(0, rows(1));
  const before = store.block(0)!;
  store.put(1, rows(2));
  expect([before.count, before.cages.length]).toEqual([1, 6]);
  expect(store.block(0)!.count).toBe(2);
});

test('errors_that_are_not_known_are_no_numbers', () => {
  const errors = new GrowingErrors();
  errors.put(1000, 0.25, 0.5);
  errors.put(3, null, 0.125);
  const { l2, linf } = errors.upTo(1001);
  expect([l2[1000], linf[1000], linf[3]]).toEqual([0.25, 0.5, 0.125]);
  expect([l2[3], l2[0], linf[999]].every(Number.isNaN)).toBe(true);
});
