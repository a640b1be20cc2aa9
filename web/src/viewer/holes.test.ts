import { expect, test } from 'vitest';
import { Holes } from './frameFeed';
import { standing } from './transport';

const playing = { ...standing(), playing: true, frames: 30 };
const problem = 'The file is damaged.';

test('playing goes on behind frames that are missing', () => {
  const holes = new Holes();
  holes.add({ first: 10, count: 5, problem });
  holes.add({ first: 15, count: 5, problem });
  expect(holes.past({ ...playing, position: 9.9 }).position).toBe(9.9);
  expect(holes.past({ ...playing, position: 10.2 })).toMatchObject({ position: 20, playing: true });
});

test('at the end it begins anew, or stops', () => {
  const holes = new Holes();
  holes.add({ first: 25, count: 5, problem });
  holes.add({ first: 0, count: 2, problem });
  expect(holes.past({ ...playing, position: 26 })).toMatchObject({ position: 2, playing: true });
  expect(holes.past({ ...playing, position: 26, repeat: 'once' })).toMatchObject({ position: 26, playing: false });
});

test('it stops where no frame is left', () => {
  const holes = new Holes();
  holes.add({ first: 0, count: 15, problem });
  holes.add({ first: 15, count: 15, problem });
  expect(holes.past({ ...playing, position: 3 }).playing).toBe(false);
});

test('what is wrong is said once', () => {
  const holes = new Holes();
  holes.add({ first: 10, count: 5, problem });
  expect([holes.news(9), holes.news(12), holes.news(13)]).toEqual([null, problem, null]);
});
