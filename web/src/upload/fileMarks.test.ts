import { expect, test } from 'vitest';
import { classify } from '../files/classify';
import { difference, marksOf, shareNames, withEarlierRoles } from './fileMarks';
import { sampledFrames } from './motionCage';

const drop = (files: Record<string, string>) =>
  classify(Object.entries(files).map(([path, content]) => ({ path, file: new File([content], path) })));
const FILES = { 'rest.obj': 'v 0 0 0', 'walk.npy': 'numbers' };

test('the_same_files_are_known_again_and_others_are_told_apart', () => {
  const earlier = marksOf(drop(FILES));
  expect(difference(marksOf(drop({ ...FILES })), earlier)).toBeNull();
  const later = marksOf(drop({ ...FILES, 'walk.npy': 'other numbers' }));
  expect(difference(later, earlier)).toBe(
    'The frames of the interrupted upload: walk.npy (7 bytes), not walk.npy (13 bytes).',
  );
  expect(difference(marksOf(drop({ 'rest.obj': 'v 0 0 0' })), earlier)).toMatch(/file missing/);
  expect(difference(marksOf(drop({ ...FILES, 'cage.obj': 'v' })), earlier)).toBe(
    'The interrupted upload had no cage: remove cage.obj.',
  );
  expect(shareNames(later, earlier)).toBe(true);
  expect(shareNames(marksOf(drop({ 'other.npy': 'numbers' })), earlier)).toBe(false);
});

test('files_get_the_roles_that_they_had', () => {
  const items = drop({ 'a.obj': 'v 0 0 0\nv 1 1 1', 'b.obj': 'v 0 0 0', 'walk.npy': 'numbers' });
  const swapped = items.map((item) => {
    if (item.role === 'frames') return item;
    return { ...item, role: item.role === 'rest' ? ('cage' as const) : ('rest' as const) };
  });
  const marks = marksOf(swapped);
  const again = withEarlierRoles(items, marks);
  expect(Object.fromEntries(again.map(({ name, role }) => [name, role]))).toEqual({
    'a.obj': 'cage',
    'b.obj': 'rest',
    'walk.npy': 'frames',
  });
  // As long as some are missing, the others may be something else.
  expect(withEarlierRoles(items.slice(1), marks)).toEqual(items.slice(1));
});

test('a_design_sees_frames_of_all_of_the_motion', () => {
  expect(sampledFrames(5, 100)).toEqual([0, 1, 2, 3, 4]);
  const many = sampledFrames(10_001, 100);
  expect([many.length, many[0], many.at(-1)]).toEqual([160, 0, 10_000]);
  expect(new Set(many).size).toBe(160);
  // Of two million points, 24 frames are half a gigabyte already.
  expect(sampledFrames(1000, 2_000_000).length).toBe(24);
  expect(sampledFrames(1, 100)).toEqual([0]);
});
