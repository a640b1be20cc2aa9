import { expect, test, vi } from 'vitest';
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

test('rest_poses_of_several_captures_are_listed_one_by_one_with_the_reason', () => {
  const folders = drop({ 'arm1/rest.obj': 10, 'arm2/rest.obj': 20, 'arm1/frames.npy': 50 });
  expect(folders.map(({ name, role }) => [name, role])).toEqual([
    ['rest.obj', 'rest'],
    ['frames.npy', 'frames'],
    ['rest.obj', 'unused'],
  ]);
  expect(folders[2].remark).toMatch(/Another file is used/);
  expect(reassigned(folders, folders[2], 'rest').map(({ role }) => role)).toEqual(['unused', 'frames', 'rest']);
  // Chosen in two folders after one another, they have one path.
  const file = new File(['v'], 'rest.obj');
  expect(classify([file, file].map((file) => ({ file, path: 'rest.obj' })))).toHaveLength(2);
  expect(roles({ 'f1/mesh.obj': 9, 'f2/mesh.obj': 9 })).toEqual({ 'mesh.obj and 1 more': 'frames' });
  expect(roles({ 'base_1.obj': 9, 'base_2.obj': 9 })).toEqual({ 'base_1.obj and 1 more': 'frames' });
});

test('what_cannot_be_used_says_why', () => {
  vi.stubGlobal('document', { baseURI: 'https://cager.example/captures/' });
  expect(drop({ 'walk.abc': 1 })[0]).toMatchObject({ choices: ['unused'] });
  expect(drop({ 'walk.usdc': 1 })[0].remark).toContain('cager encode --server https://cager.example/captures”');
  expect(drop({ 'done.cager': 1 })[0].remark).toContain('Already encoded');
  expect(drop({ 'notes.txt': 1 })[0]).toMatchObject({ role: 'unused', choices: ['unused'] });
});

test('a_role_that_is_given_is_taken_from_whatever_had_it', () => {
  const items = drop({ 'low.obj': 10, 'high.obj': 100, 'a.npy': 5, 'b.npy': 9 });
  const other = items.find(({ name }) => name === 'a.npy')!;
  const changed = Object.fromEntries(reassigned(items, other, 'frames').map(({ name, role }) => [name, role]));
  expect(changed).toEqual({ 'low.obj': 'cage', 'high.obj': 'rest', 'a.npy': 'frames', 'b.npy': 'unused' });
});
