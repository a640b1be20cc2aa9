import { describe, expect, it } from 'vitest';
import { CODEC, HEADER_BYTES, viewOf } from './section';
import {
  allBlocks,
  goldenBytes,
  offsetOf,
  openBytes,
  type Part,
  rawPart,
  streamedPart,
  withPart,
} from '../../tests/support/containers';

const POINTS = 120;
const golden = goldenBytes('definition3-mvc');
const colors = Uint8Array.from({ length: 3 * POINTS }, (_, k) => (11 * k) % 256);
const colored = (part: Part = rawPart('rcol', colors), behind = 'RFAC') => withPart(golden, part, behind);

describe('colours of the model', () => {
  it('are those of the section, wherever it is', async () => {
    for (const behind of ['RFAC', 'HEAD', 'CTRI', 'ERRS']) {
      const bytes = colored(rawPart('rcol', colors), behind);
      const capture = await openBytes(bytes);
      expect([capture.problem, capture.static.colors], behind).toEqual([null, colors]);
      expect((await streamedPart(bytes))!.colors, behind).toEqual(/RFAC|HEAD/.test(behind) ? colors : undefined);
    }
  });

  it('are absent where there is no such section', async () => {
    expect((await openBytes(golden)).static.colors).toBeUndefined();
    expect((await streamedPart(golden))!.colors).toBeUndefined();
  });

  it('can be compressed', async () => {
    // A zstd frame that repeats one byte.
    const [size, block] = [3 * POINTS - 256, (3 * POINTS * 8) | 2 | 1];
    const frame = Uint8Array.of(0x28, 0xb5, 0x2f, 0xfd, 0x60, size, 0, block & 255, block >> 8, 0, 200);
    const part = rawPart('rcol', frame);
    part.header[4] = CODEC.planes;
    viewOf(part.header).setBigUint64(24, BigInt(3 * POINTS), true);
    const grey = new Uint8Array(3 * POINTS).fill(200);
    expect((await openBytes(colored(part))).static.colors).toEqual(grey);
    expect((await streamedPart(colored(part)))!.colors).toEqual(grey);
  });
});

describe('a file is damaged', () => {
  const refused = async (bytes: Uint8Array, reason: RegExp) => {
    await expect(openBytes(bytes)).rejects.toThrow(reason);
    await expect(streamedPart(bytes)).rejects.toThrow(reason);
  };

  it.each([
    ['too few colours', rawPart('rcol', colors.slice(3))],
    ['too many colours', rawPart('rcol', new Uint8Array(3 * POINTS + 3))],
    ['colours of another width', rawPart('rcol', colors, 3)],
  ])('with %s', (_, part) => refused(colored(part), /damaged.*does not have the size that the header gives it/));

  it('with colours twice', async () => {
    const twice = withPart(colored(), rawPart('rcol', colors), 'rcol');
    await expect(openBytes(twice)).rejects.toThrow(/damaged/);
    await expect(streamedPart(twice)).rejects.toThrow(/damaged.*rcol is there twice/);
  });

  it('where it was cut within its colours', async () => {
    const bytes = colored();
    const cut = bytes.subarray(0, offsetOf(bytes, 'rcol') + HEADER_BYTES + 100);
    await expect(openBytes(cut)).rejects.toThrow(/damaged.*CVTX is missing/);
    expect(await streamedPart(cut)).toBeNull();
  });
});

describe('the model is shown without its colours', () => {
  it.each([
    ['a byte of them was changed', /checksum/],
    ['a later program coded them', /codec 9/],
  ])('where %s', async (_, problem) => {
    const part = rawPart('rcol', colors);
    if (problem.source.startsWith('codec')) part.header[4] = 9;
    const bytes = colored(part);
    if (problem.source === 'checksum') bytes[offsetOf(bytes, 'rcol') + HEADER_BYTES + 7] ^= 1;
    const capture = await openBytes(bytes);
    expect(capture.problem).toMatch(problem);
    expect(capture.static.colors).toBeUndefined();
    expect((await allBlocks(capture)).length).toBe(1);
    expect((await streamedPart(bytes))!.colors).toBeUndefined();
  });
});
