import { expect, test } from 'vitest';
import type { FrameSource } from '../files/frameSource';
import { ServiceProblem } from '../service/problem';
import type { Service } from '../service/service';
import { FrameSender } from './frameSender';

const source: FrameSource = {
  frames: 40,
  points: 1000,
  description: '',
  read: (_, count) => Promise.resolve(new Float32Array(3000 * count)),
};

test('a proxy that takes no large bodies gets frames in smaller ones', async () => {
  const taken: [number, number][] = [];
  const service = {
    request: (path: string, { body }: { body: Float32Array }) => {
      if (body.byteLength > 100_000) return Promise.reject(new ServiceProblem('unknown', 413));
      taken.push([Number(/first=(\d+)/.exec(path)![1]), body.length / 3000]);
      return Promise.resolve(new Response(''));
    },
  } as unknown as Service;
  let sent = 0;
  const sender = new FrameSender(service, 'frames', source, {
    solved: () => undefined,
    sent: (count) => (sent += count),
  });
  await sender.send([[0, 40]], new AbortController().signal);
  expect(sent).toBe(40);
  const frames = taken.flatMap(([first, count]) => Array.from({ length: count }, (_, k) => first + k));
  expect(frames.sort((a, b) => a - b)).toEqual(Array.from({ length: 40 }, (_, k) => k));
  // What follows is not too large again.
  const before = taken.length;
  await sender.send([[0, 40]], new AbortController().signal);
  expect(Math.max(...taken.slice(before).map(([, count]) => count))).toBeLessThanOrEqual(8);
});

test('a single frame that is too large is refused', async () => {
  const service = { request: () => Promise.reject(new ServiceProblem('unknown', 413)) } as unknown as Service;
  const sender = new FrameSender(service, 'frames', source, { solved: () => undefined, sent: () => undefined });
  await expect(sender.send([[0, 8]], new AbortController().signal)).rejects.toMatchObject({ status: 413 });
});
