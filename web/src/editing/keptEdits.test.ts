import { expect, it } from 'vitest';
import type { Capture } from '../capture';
import { bytesSource } from '../container/source';
import type { CageEdit } from './cageEdit';
import { identityOf, isUsable } from './keptEdits';

const edit: CageEdit = {
  id: 1,
  grip: {
    chosen: [2],
    own: Float64Array.of(0, 0.5, 1),
    mirror: { axis: 0, chosen: [0], own: Float64Array.of(1, 0.5, 0) },
  },
  motion: { kind: 'rotate', rotation: [0, 0, 0, 1] },
  range: { first: 3, last: 9, easeIn: 2, easeOut: 0 },
  enabled: true,
};

it('what was kept is taken up only where it fits the cage and is whole', () => {
  expect(isUsable(edit, 3)).toBe(true);
  expect(isUsable(edit, 4)).toBe(false);
  const { grip, range } = edit;
  const damaged: unknown[] = [
    null,
    {},
    { ...edit, grip: { ...grip, chosen: [3] } },
    { ...edit, grip: { ...grip, chosen: [] } },
    { ...edit, grip: { ...grip, own: [0, 0.5, 1] } },
    { ...edit, grip: { ...grip, own: Float64Array.of(0, NaN, 1) } },
    { ...edit, grip: { ...grip, mirror: { ...grip.mirror, axis: 7 } } },
    { ...edit, range: { ...range, last: 1 } },
    { ...edit, range: { ...range, easeIn: 0.5 } },
    { ...edit, motion: { kind: 'scale', factors: [1, 0, 1] } },
    { ...edit, motion: { kind: 'move', by: [0, Infinity, 0] } },
    { ...edit, motion: { kind: 'bend' } },
  ];
  expect(damaged.filter((one) => isUsable(one as CageEdit, 3))).toEqual([]);
});

it('a file is known by its name, its length and its ends, a session by its address', async () => {
  const bytes = Uint8Array.from({ length: 200_000 }, (_, k) => k % 251);
  const capture = (name: string, content: Uint8Array, identity?: string) =>
    ({ name, container: () => Promise.resolve(bytesSource(content)), ...(identity && { identity }) }) as Capture;
  const known = await identityOf(capture('walk.cager', bytes));
  expect(await identityOf(capture('walk.cager', bytes.slice()))).toBe(known);
  const other = bytes.slice();
  other[other.length - 5] ^= 1;
  expect(await identityOf(capture('walk.cager', other))).not.toBe(known);
  expect(await identityOf(capture('run.cager', bytes))).not.toBe(known);
  expect(await identityOf(capture('walk.cager', bytes, 'session 7'))).toBe('session 7');
  expect(await identityOf({ name: 'stream' } as Capture)).toBeNull();
});
