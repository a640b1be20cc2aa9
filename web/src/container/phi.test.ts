import { expect, it, vi } from 'vitest';
import { computeCoordinates } from '../coordinates/compute';
import { goldenBytes, openBytes } from '../../tests/support/containers';

vi.mock('../coordinates/compute', { spy: true });
const never = new AbortController().signal;

it('coordinates are computed once for the picture and for the coded cages', async () => {
  const capture = await openBytes(goldenBytes('coded-mvc'));
  const [block, phi] = await Promise.all([capture.block(0), capture.phi!(() => undefined, never)]);
  expect(block.cages.length).toBeGreaterThan(0);
  expect(computeCoordinates).toHaveBeenCalledTimes(1);
  const { system, cage, rest } = capture.static;
  expect(phi).toEqual(Float32Array.from(computeCoordinates(system, cage, rest)));
});

it('a picture that is given up does not keep cages from being decoded', async () => {
  const capture = await openBytes(goldenBytes('coded-mvc'));
  const stop = new AbortController();
  const phi = capture.phi!(() => undefined, stop.signal);
  stop.abort(new Error('given up'));
  await expect(phi).rejects.toThrow('given up');
  expect((await capture.block(0)).cages.length).toBeGreaterThan(0);
});
