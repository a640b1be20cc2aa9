import { expect, it } from 'vitest';
import type { FrameBlock, StaticPart } from '../capture';
import { LocalCodec } from '../codec/localCodec';
import { ContainerStream } from './stream';
import { allBlocks, GOLDEN, goldenBytes, offsetOf, openBytes } from './testSupport';

/** Any coordinates do: they are the same whichever way the file is read. */
const coordinates = (part: StaticPart, points: Float64Array) =>
  Promise.resolve(
    Float64Array.from({ length: (points.length / 3) * part.rowsPerFrame }, (_, k) => ((k * 7) % 11) / 10),
  );

async function read(bytes: Uint8Array, piece: number) {
  const events: string[] = [];
  const blocks: FrameBlock[] = [];
  let part: StaticPart | null = null;
  const stream = new ContainerStream({
    codec: new LocalCodec(),
    coordinates,
    onStatic: (found) => {
      events.push('static');
      part = found;
    },
    onBlock: (block) => {
      events.push('block');
      blocks.push(block);
    },
  });
  for (let at = 0; at < bytes.length; at += piece) {
    await stream.push(bytes.subarray(at, at + piece));
  }
  return { part: part as StaticPart | null, blocks, events, end: await stream.finish() };
}

it.each(GOLDEN)('%s is the same in pieces of any size as read at random', async (name) => {
  const bytes = goldenBytes(name);
  const capture = await openBytes(bytes, { coordinates });
  const blocks = await allBlocks(capture);
  for (const piece of [1, 7, bytes.length]) {
    const found = await read(bytes, piece);
    expect(found.end.problem).toBeNull();
    expect(found.end.complete).toBe(true);
    expect(found.events).toEqual(['static', ...blocks.map(() => 'block')]);
    expect({ ...found.part, report: found.end.report }).toEqual(capture.static);
    expect(found.blocks).toEqual(blocks);
    expect(found.end.errors).toEqual(capture.errors);
    expect(found.end.frames).toBe(capture.frames);
  }
});

it('model and cage are there before the frames are', async () => {
  const bytes = goldenBytes('definition3-green');
  const found = await read(bytes.subarray(0, offsetOf(bytes, 'FRAM')), 100);
  expect(found.events).toEqual(['static']);
  expect(found.end).toMatchObject({ complete: false, frames: 0, problem: expect.stringMatching(/was cut/) as string });
});

it('bytes after the end are a problem', async () => {
  const bytes = goldenBytes('definition3-green');
  const longer = new Uint8Array(bytes.length + 1);
  longer.set(bytes);
  expect((await read(longer, 1000)).end).toMatchObject({
    complete: true,
    problem: expect.stringMatching(/after the end/) as string,
  });
});
