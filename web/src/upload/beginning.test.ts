import { expect, test } from 'vitest';
import { captureName } from './beginning';
import { classify } from '../files/classify';
import type { Plan } from './plan';

test.each([
  [['samba/frames.npy', 'samba/rest.obj'], 'samba'],
  [['frames.npy', 'dancer.obj'], 'dancer'],
  [['walk.npy', 'rest.obj'], 'walk'],
  [['frames/0001.obj', 'frames/0002.obj', 'frames/0003.obj'], /^Capture of \d/],
  [['frames.npy', 'rest.obj'], /^Capture of \d/],
])('%j is named after what says something', (paths, name) => {
  const dropped = paths.map((path) => ({ path, file: new File(['x'], path.split('/').at(-1)!) }));
  const rest = dropped.find(({ path }) => path.endsWith('.obj'))!.file;
  expect(captureName({ rest } as Plan, dropped, classify(dropped))).toMatch(name);
});
