import { describe, expect, it } from 'vitest';
import { writeEdited } from '../editing/editedContainer';
import { LocalCodec } from '../../tests/support/localCodec';
import { openOriginal } from '../originals/original';
import { bytesSource } from './source';
import { goldenBytes, openBytes, rawPart, streamedPart, takeApart, withPart } from '../../tests/support/containers';

const golden = goldenBytes('definition3-mvc');
const origin = Float64Array.of(450000, 5400000, 0.5);
const far = (numbers = origin, width = 8) =>
  withPart(golden, rawPart('ORIG', new Uint8Array(numbers.slice().buffer), width), 'HEAD');

describe('a capture far away', () => {
  it('is shown about its origin, and known to have one', async () => {
    const capture = await openBytes(far());
    const near = await openBytes(golden);
    expect(capture.problem).toBeNull();
    expect(capture.static.origin).toEqual(origin);
    expect(capture.static.rest).toEqual(near.static.rest);
    expect(near.static.origin).toBeUndefined();
    expect((await streamedPart(far()))!.origin).toEqual(origin);
  });

  it('keeps its origin when its cages are edited', async () => {
    const bytes = far();
    const capture = await openBytes(bytes);
    const { container } = await writeEdited(bytesSource(bytes), capture, [], { codec: new LocalCodec() });
    const written = new Uint8Array(await container.arrayBuffer());
    expect(takeApart(written)[1]).toEqual(takeApart(bytes)[1]);
    expect((await openBytes(written)).static.origin).toEqual(origin);
  });

  it('is not compared with frames that the page would round', async () => {
    const capture = await openBytes(far());
    const file = new File(['v 0 0 0\n'], 'frame.obj');
    await expect(openOriginal([{ path: file.name, file }], capture)).rejects.toThrow(/far from the origin/);
  });

  it('is damaged where its origin is no place', async () => {
    await expect(openBytes(far(Float64Array.of(0, NaN, 0)))).rejects.toThrow(/not finite/);
    await expect(openBytes(far(Float64Array.of(0, 0)))).rejects.toThrow(/size/);
    await expect(openBytes(far(origin, 4))).rejects.toThrow(/size/);
  });
});
