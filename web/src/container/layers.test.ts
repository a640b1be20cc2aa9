import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { allBlocks, goldenBytes, openBytes, putTogether, rawPart, takeApart } from '../../tests/support/containers';
import { encodeLayer, layerBetween, type StoredLayer } from './layers';
import { withEdits } from './rewrite';
import { HEADER_BYTES, viewOf } from './section';

const golden = goldenBytes('definition3-mvc');
const layer = {
  name: 'Nose',
  isOn: true,
  first: 1,
  count: 2,
  vertices: Uint32Array.of(3, 9),
  offsets: new Float32Array(12),
};

/** The golden file with an edit of these bytes, of these frames. */
function edited(raw: Uint8Array<ArrayBuffer>, first = 1, count = 2, layers = 1): Uint8Array<ArrayBuffer> {
  const part = rawPart('EDIT', raw, 4);
  viewOf(part.header).setUint32(8, first, true);
  viewOf(part.header).setUint32(12, count, true);
  return putTogether([...takeApart(golden), ...Array.from({ length: layers }, () => part)]);
}

/** The layer's bytes with one word replaced. */
function changed(at: number, word: number): Uint8Array<ArrayBuffer> {
  const raw = encodeLayer(layer);
  viewOf(raw).setUint32(at, word, true);
  return raw;
}

describe('a layer of edits', () => {
  it('is read as it was written', async () => {
    const capture = await openBytes(edited(encodeLayer({ ...layer, isOn: false })));
    expect(capture.problem).toBeNull();
    expect(capture.layers).toMatchObject([{ ...layer, isOn: false }]);
  });

  it.each([
    ['unknown flags', changed(0, 2), /flags/],
    ['no vertices', changed(4, 0), /size/],
    ['more vertices than bytes', changed(4, 2 ** 31), /size/],
    ['a vertex twice', changed(12, 3), /order/],
    ['a vertex that the cage has not', changed(12, 26), /order/],
    ['a number that is none', changed(16, 0x7fc00000), /not finite/],
    ['a name that is no text', Uint8Array.from([...encodeLayer(layer), 0xff]), /name/],
    ['a name that is too long', Uint8Array.from([...encodeLayer(layer), ...new Uint8Array(300)]), /size/],
    ['less than a head', new Uint8Array(5), /cut/],
  ])('with %s is left out, and said', async (_, raw, problem) => {
    const capture = await openBytes(edited(raw));
    expect(capture.problem).toMatch(problem);
    expect(capture.layers).toEqual([]);
    await expect(withEdits(await capture.container!(), [])).rejects.toThrow(/Layer 1 .* --remove 1 first/);
    expect(await allBlocks(capture)).toEqual(await allBlocks(await openBytes(golden)));
  });

  it('whose bytes changed is left out, and not lost where others are saved', async () => {
    const bytes = edited(encodeLayer(layer), 1, 2, 2);
    const first = await openBytes(bytes);
    bytes[(first.layers![1] as StoredLayer).stored.entry.offset + HEADER_BYTES + 20] ^= 1;
    const capture = await openBytes(bytes);
    expect(capture.layers).toHaveLength(1);
    await expect(withEdits(await capture.container!(), capture.layers!)).rejects.toThrow(/--remove 2 first/);
    // Those that can be read are taken out where somebody wants that.
    expect((await withEdits(await first.container!(), first.layers!.slice(1))).size).toBeLessThan(bytes.length);
  });

  it('of frames that there are not is left out; of more than there may be the file is refused', async () => {
    for (const [first, count] of [
      [2, 2],
      [0, 0],
      [2 ** 32 - 1, 2],
    ]) {
      const capture = await openBytes(edited(encodeLayer(layer), first, count));
      expect(capture.problem).toMatch(/frames that there are not/);
    }
    expect((await openBytes(edited(encodeLayer(layer), 1, 2, 256))).layers!.length).toBe(256);
    const many = await openBytes(edited(encodeLayer(layer), 1, 2, 257));
    expect(many.problem).toMatch(/more than 256 edits/);
  });
});

describe('the layer between cages', () => {
  const rows = (...numbers: number[]) => Float32Array.of(...numbers);

  it('has the frames and vertices that differ, and nothing of rounding', () => {
    const ulp = 2 ** -23;
    const before = [0, 1, 2, 3, 4].map(() => rows(1, 1, 1, 2, 2, 2, 1, 1, 1));
    const after = before.map((frame) => frame.slice());
    after[0][0] += 4 * ulp;
    after[1][1] += 5 * ulp;
    after[3].set([0.5, 2 + 8 * ulp, 3], 3);
    const found = layerBetween(before, after, 10, 'Nose')!;
    expect(found).toMatchObject({ name: 'Nose', isOn: true, first: 11, count: 3 });
    expect([...found.vertices]).toEqual([0, 1]);
    const none = [0, 0, 0];
    expect([...found.offsets]).toEqual([0, 5 * ulp, 0, ...none, ...none, ...none, ...none, -1.5, 0, 1]);
  });

  it('is none where nothing differs', () => {
    expect(layerBetween([rows(0, 0, 0)], [rows(0, -0, 5e-45)], 0, '')).toBeNull();
  });

  interface Case {
    readonly what: string;
    readonly name: string;
    readonly old: readonly number[][];
    readonly new: readonly number[][];
    readonly first: number | null;
    readonly count: number | null;
    readonly raw: string | null;
  }
  const { cases } = JSON.parse(
    readFileSync(new URL('../../../tests/golden/edit-layer.json', import.meta.url), 'utf8'),
  ) as { cases: readonly Case[] };

  it.each(cases)(
    'has the same bytes as that of the program: $what',
    ({ name, old, new: edited, first, count, raw }) => {
      const [before, after] = [old, edited].map((frames) => frames.map((frame) => Float32Array.from(frame)));
      const found = layerBetween(before, after, 0, name);
      expect(found && [found.first, found.count]).toEqual(first === null ? null : [first, count]);
      expect(found && Buffer.from(encodeLayer(found)).toString('hex')).toBe(raw);
    },
  );
});
