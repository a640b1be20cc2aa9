import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Capture, FrameBlock } from '../capture';
import { FrameStore } from '../render/frameStore';
import { ServiceProblem } from '../service/problem';
import { FrameFeed } from './frameFeed';
import { standing } from './transport';

const playing = { ...standing(), playing: true, frames: 30 };
const settled = () => new Promise((resolve) => setTimeout(resolve));

/** Node has no network that comes back; this one does when the test says so. */
const network = new EventTarget();
beforeEach(() => void vi.stubGlobal('addEventListener', network.addEventListener.bind(network)));
afterEach(() => void vi.unstubAllGlobals());

/** A feed of 30 frames in blocks of 10, whose source answers what `answer` says. */
function setUp(answer: (first: number) => Error | null) {
  const asked: number[] = [];
  const heard: string[] = [];
  const capture = {
    static: { rest: new Float64Array(3), rowsPerFrame: 1 },
    events: new EventTarget(),
    readTogether: (frame: number) => ({ first: frame - (frame % 10), count: 10 }),
    block: (frame: number): Promise<FrameBlock> => {
      const first = frame - (frame % 10);
      asked.push(first);
      const error = answer(first);
      return error
        ? Promise.reject(error)
        : Promise.resolve({ first, count: 10, cages: new Float32Array(30), residual: null });
    },
  } as unknown as Capture;
  const store = new FrameStore(capture);
  const feed = new FrameFeed(capture, store, {
    changed: () => heard.push('changed'),
    troubled: (problem) => heard.push(problem),
    recovered: (problem) => heard.push(`over: ${problem}`),
  });
  store.onBlock = (block) => feed.arrived(block);
  return { feed, store, asked, heard };
}

test('frames that a broken connection held back are waited for, asked for again, and not left out', async () => {
  const failures = [new ServiceProblem('unreachable', 0)];
  const { feed, asked, heard } = setUp((first) => (first === 10 ? (failures.pop() ?? null) : null));
  feed.load(12);
  await settled();
  expect(feed.holes.at(12)).toBeNull();
  expect(heard).toEqual([new ServiceProblem('unreachable', 0).message]);
  // Nothing is asked for while it waits.
  feed.load(12);
  feed.prefetch({ ...playing, position: 12 });
  expect(asked).toEqual([10]);
  network.dispatchEvent(new Event('online'));
  await settled();
  expect(heard.at(-1)).toBe('changed');
  feed.load(12);
  await settled();
  expect(asked).toEqual([10, 10]);
  expect(heard.at(-1)).toMatch(/^over: Cannot reach/);
  expect(feed.at({ ...playing, position: 12 })).toMatchObject({ before: 12 });
  feed.close();
});

test('a hole is gone when its frames come by another way, and so is what was said of it', async () => {
  let isBroken = true;
  const { feed, store, heard } = setUp((first) => (first === 10 && isBroken ? new Error('It is damaged.') : null));
  feed.load(12);
  await settled();
  expect(feed.holes.news(12)).toBe('It is damaged.');
  expect(feed.holes.past({ ...playing, position: 12 }).position).toBe(20);
  isBroken = false;
  await store.read(15);
  expect(feed.holes.at(12)).toBeNull();
  expect(heard.at(-1)).toBe('over: It is damaged.');
  expect(feed.holes.past({ ...playing, position: 12 }).position).toBe(12);
  feed.close();
});
