import { describe, expect, it } from 'vitest';
import { ContainerError } from './error';
import { HEADER_BYTES, parseFields, PRELUDE_BYTES, viewOf } from './section';
import {
  allBlocks,
  goldenBytes,
  offsetOf,
  openBytes,
  putTogether,
  randomNumbers,
  rawPart,
  sign,
  streamedPart,
  takeApart,
  withPart,
} from '../../tests/support/containers';

const SENTENCES = /^[A-Z].*\.$/s;

/** What a person is told of these bytes, at opening or in a capture's `problem`; null if nothing is wrong. */
async function complaint(bytes: Uint8Array): Promise<string | null> {
  try {
    const capture = await openBytes(bytes);
    try {
      await allBlocks(capture);
    } finally {
      capture.close();
    }
    return capture.problem;
  } catch (error) {
    expect(error).toBeInstanceOf(ContainerError);
    return (error as Error).message;
  }
}

/** What is wrong with model and cage of bytes that are read from front to back; null for those that are whole, or cut. */
async function streamComplaint(bytes: Uint8Array): Promise<string | null> {
  try {
    await streamedPart(bytes);
    return null;
  } catch (error) {
    expect(error).toBeInstanceOf(ContainerError);
    return (error as Error).message;
  }
}

describe.each(['coded-mvc', 'definition3-mvc'])('the file %s', (name) => {
  const intact = goldenBytes(name);

  it('is without a problem when it is whole', async () => {
    expect(await complaint(intact)).toBeNull();
    expect(await streamComplaint(intact)).toBeNull();
  });

  it('cut at any length gives a sentence', async () => {
    for (let length = 0; length < intact.length; length += length < 60 ? 1 : 47) {
      expect(await complaint(intact.subarray(0, length)), `${length} bytes`).toMatch(SENTENCES);
      expect(await streamComplaint(intact.subarray(0, length)), `${length} bytes`).toBeNull();
    }
  });

  it('with a bit changed anywhere gives a sentence', async () => {
    for (let at = 0; at < intact.length; at += 11) {
      const bytes = intact.slice();
      bytes[at] ^= 1 << (at & 7);
      expect(await complaint(bytes), `byte ${at}`).toMatch(SENTENCES);
      expect((await streamComplaint(bytes)) ?? 'Fine.', `byte ${at}`).toMatch(SENTENCES);
    }
  });

  it('with numbers in its payloads changed and right checksums gives a sentence or a capture', async () => {
    const random = randomNumbers(7);
    for (let turn = 0; turn < 60; turn++) {
      const parts = takeApart(intact);
      const { payload } = parts[random(parts.length)];
      for (let k = random(4); k >= 0; k--) payload[random(payload.length)] = random(2) === 0 ? 0xff : random(256);
      const bytes = putTogether(parts);
      expect((await complaint(bytes)) ?? 'Fine.', `turn ${turn}`).toMatch(SENTENCES);
      expect((await streamComplaint(bytes)) ?? 'Fine.', `turn ${turn}`).toMatch(SENTENCES);
    }
  });

  it('with a field of a section set to an extreme and right checksums gives a sentence or a capture', async () => {
    const count = takeApart(intact).length;
    const fields = [4, 5, 6, 8, 12, 24, 28];
    for (let place = 0; place < count; place++) {
      for (const field of fields) {
        for (const value of [0, 1, 3, 4, 0x7f, 0xff]) {
          const parts = takeApart(intact);
          parts[place].header.fill(value, field, field < 8 ? field + 1 : field + 4);
          const bytes = putTogether(parts);
          expect((await complaint(bytes)) ?? 'Fine.', `${place} ${field} ${value}`).toMatch(SENTENCES);
          expect((await streamComplaint(bytes)) ?? 'Fine.', `${place} ${field} ${value}`).toMatch(SENTENCES);
        }
      }
    }
  });
});

it('of a file that was cut, the frames before the cut can be read', async () => {
  const intact = goldenBytes('definition3-mvc');
  const cut = intact.subarray(0, offsetOf(intact, 'ERRS') + 10);
  const capture = await openBytes(cut);
  expect(capture.problem).toMatch(/the end is missing/);
  expect((await allBlocks(capture))[0].cages).toEqual((await allBlocks(await openBytes(intact)))[0].cages);
  expect(capture.errors.l2.length).toBe(0);
});

it('a damaged residual leaves the frames of the cages', async () => {
  const intact = goldenBytes('coded-green');
  const bytes = intact.slice();
  bytes[offsetOf(intact, 'resi') + HEADER_BYTES + 100] ^= 4;
  const capture = await openBytes(bytes);
  const [block] = await allBlocks(capture);
  expect(block.residual).toBeNull();
  expect(block.cages).toEqual((await allBlocks(await openBytes(intact)))[0].cages);
  expect(capture.problem).toMatch(/checksum/);
});

it('a damaged chunk is named, and the one after it is read', async () => {
  const parts = takeApart(goldenBytes('definition3-mvc'));
  const place = parts.findIndex(({ header }) => parseFields(header, 0).tag === 'FRAM');
  const chunk = parts[place];
  const second = { header: chunk.header.slice(), payload: chunk.payload };
  viewOf(second.header).setUint32(8, 3, true);
  const errors = rawPart('ERRS', new Uint8Array(48), 4);
  const bytes = putTogether([...parts.slice(0, place + 1), second, errors]);
  bytes[offsetOf(bytes, 'FRAM') + HEADER_BYTES + 5] ^= 1;
  const capture = await openBytes(bytes);
  await expect(capture.block(0)).rejects.toThrow(/checksum/);
  expect((await capture.block(5)).first).toBe(3);
});

describe('a file of another program', () => {
  const intact = goldenBytes('definition3-mvc');

  it('with an unknown optional section is read as if that was not there', async () => {
    const bytes = withPart(intact, rawPart('xtra', Uint8Array.of(1, 2, 3)), 'HEAD');
    expect(await complaint(bytes)).toBeNull();
    expect(await streamComplaint(bytes)).toBeNull();
  });

  it('with an unknown required section is refused by the name of that', async () => {
    const bytes = withPart(intact, rawPart('XTRA', Uint8Array.of(1, 2, 3)), 'HEAD');
    expect(await complaint(bytes)).toMatch(/“XTRA”.*newer viewer/);
    expect(await streamComplaint(bytes)).toMatch(/“XTRA”.*newer viewer/);
  });

  it('with a report in an unknown codec is read without the report', async () => {
    const changed = takeApart(goldenBytes('definition3-mvc'));
    changed.find(({ header }) => parseFields(header, 0).tag === 'summ')!.header[4] = 9;
    const bytes = putTogether(changed);
    const capture = await openBytes(bytes);
    expect(capture.static.report).toBeNull();
    expect(capture.problem).toMatch(/codec 9/);
    expect((await allBlocks(capture)).length).toBe(1);
  });

  it.each([
    ['FRAM', 4, /codec 4 of the section FRAM/],
    ['resi', 4, /a residual is not followed by its frames/],
    ['ERRS', 3, /codec 3 of the section ERRS/],
    ['RFAC', 3, /codec 3 of the section RFAC/],
    ['RPTS', 3, /codec 3 of the section RPTS/],
    ['RPTS', 5, /codec 5 of the section RPTS/],
  ])('with the section %s in codec %i, which it never has, is refused', async (tag, codec, sentence) => {
    const changed = takeApart(goldenBytes('coded-green'));
    changed.find(({ header }) => parseFields(header, 0).tag === tag)!.header[4] = codec;
    const bytes = putTogether(changed);
    expect(await complaint(bytes)).toMatch(sentence);
  });

  it('of a newer version is refused by its number', async () => {
    const bytes = goldenBytes('definition3-mvc');
    bytes[8] = 2;
    sign(bytes.subarray(0, PRELUDE_BYTES));
    expect(await complaint(bytes)).toMatch(/version 2/);
    expect(await streamComplaint(bytes)).toMatch(/version 2/);
  });

  it('of another kind is refused with what to choose', async () => {
    const text = new TextEncoder().encode('solid teapot\nfacet normal 0 0 1\n');
    expect(await complaint(text)).toMatch(/not a \.cager file/);
    expect(await streamComplaint(text)).toMatch(/not a \.cager file/);
  });

  it.each([2, 4])('with coordinates of definition %i is refused', async (definition) => {
    const changed = takeApart(goldenBytes('definition3-mvc'));
    viewOf(changed[0].payload).setUint32(0, definition, true);
    expect(await complaint(putTogether(changed))).toMatch(`definition ${definition}`);
  });

  // Coded sections, of 200,000 points as any, may become 2 MiB and 16 times the file.
  it.each([
    ['definition3-mvc', 2n ** 32n - 1n],
    ['coded-mvc', 200_000n],
  ])('like %s that declares more than it can hold is refused before memory is taken', async (name, most) => {
    const [head, points, ...others] = takeApart(goldenBytes(name));
    const count = viewOf(head.payload).byteLength - 1 - 4 - 8 * 5;
    expect(Number(viewOf(head.payload).getBigUint64(count, true))).toBe(120);
    viewOf(head.payload).setBigUint64(count, most, true);
    viewOf(points.header).setBigUint64(24, 3n * BigInt(points.header[5]) * most, true);
    expect(await complaint(putTogether([head, points, ...others]))).toMatch(/more bytes than the file can hold/);
  });
});
