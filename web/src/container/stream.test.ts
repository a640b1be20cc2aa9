import { expect, it } from 'vitest';
import {
  GOLDEN,
  goldenBytes,
  offsetOf,
  openBytes,
  streamedPart,
  withPart,
  rawPart,
} from '../../tests/support/containers';

it.each(GOLDEN)('model and cage of %s are the same in pieces of any size as read at random', async (name) => {
  const bytes = goldenBytes(name);
  const { report, ...part } = (await openBytes(bytes)).static;
  for (const piece of [1, 7, bytes.length]) {
    expect(await streamedPart(bytes, piece)).toEqual({ ...part, report: report && null });
  }
});

it('model and cage are there before the frames are, and not before they are whole', async () => {
  const bytes = goldenBytes('definition3-green');
  expect(await streamedPart(bytes.subarray(0, offsetOf(bytes, 'FRAM')), 100)).not.toBeNull();
  expect(await streamedPart(bytes.subarray(0, offsetOf(bytes, 'CTRI') + 60), 100)).toBeNull();
});

it('an unknown optional section is passed over, in pieces too', async () => {
  const bytes = goldenBytes('definition3-green');
  const longer = withPart(bytes, rawPart('xtra', new Uint8Array(50)), 'HEAD');
  expect(await streamedPart(longer, 7)).toEqual(await streamedPart(bytes));
});
