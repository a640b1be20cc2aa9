import { expect, test } from 'vitest';
import { classify, reassigned } from './classify';

const drop = (files: Record<string, number>) =>
  classify(
    Object.entries(files).map(([path, size]) => ({
      path,
      file: new File([new Uint8Array(size)], path.split('/').at(-1)!),
    })),
  );
const roles = (files: Record<string, number>) => Object.fromEntries(drop(files).map(({ name, role }) => [name, role]));

test('files_are_taken_for_what_their_names_and_sizes_say', () => {
  expect(roles({ 'hero_cage.obj': 10, 'hero.obj': 100, 'walk.npy': 1000 })).toEqual({
    'hero_cage.obj': 'cage',
    'hero.obj': 'rest',
    'walk.npy': 'frames',
  });
  expect(roles({ 'low.ply': 10, 'high.ply': 100, 'walk.pc2': 50 })).toEqual({
    'low.ply': 'cage',
    'high.ply': 'rest',
    'walk.pc2': 'frames',
  });
  expect(roles({ 'take.mdd': 1 })).toEqual({ 'take.mdd': 'frames' });
  expect(roles({ 'rest_pose.obj': 10, 'other.obj': 90, 'walk.npy': 5 })).toMatchObject({ 'rest_pose.obj': 'rest' });
});

test('a_folder_of_numbered_meshes_is_a_row_of_frames_in_natural_order', () => {
  const items = drop({
    'walk/f10.obj': 5,
    'walk/f2.obj': 5,
    'walk/f1.obj': 5,
    'walk/rest.obj': 9,
    'walk/.DS_Store': 1,
  });
  const frames = items.find(({ role }) => role === 'frames')!;
  expect(frames.files.map(({ name }) => name)).toEqual(['f1.obj', 'f2.obj', 'f10.obj']);
  expect(frames.name).toBe('f1.obj and 2 more');
  expect(items.map(({ role }) => role)).toEqual(['rest', 'frames']);
});

test('what_cannot_be_used_says_why', () => {
  expect(drop({ 'done.cager': 1 })[0].remark).toContain('Already encoded');
  expect(drop({ 'notes.txt': 1 })[0]).toMatchObject({ role: 'unused', choices: ['unused'] });
});

test('a_role_that_is_given_is_taken_from_whatever_had_it', () => {
  const items = drop({ 'low.obj': 10, 'high.obj': 100, 'a.npy': 5, 'b.npy': 9 });
  const other = items.find(({ name }) => name === 'a.npy')!;
  const changed = Object.fromEntries(reassigned(items, other, 'frames').map(({ name, role }) => [name, role]));
  expect(changed).toEqual({ 'low.obj': 'cage', 'high.obj': 'rest', 'a.npy': 'frames', 'b.npy': 'unused' });
});
