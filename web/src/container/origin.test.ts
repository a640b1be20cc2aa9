import { describe, expect, it } from 'vitest';
import { withEdits } from './rewrite';
import { openOriginal } from '../originals/original';
import { bytesSource } from './source';
import { goldenBytes, openBytes, rawPart, streamedPart, withPart } from '../../tests/support/containers';

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
    const written = new Uint8Array(await (await withEdits(bytesSource(bytes), capture.layers!)).arrayBuffer());
    expect(written).toEqual(bytes);
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

describe('the axis that points up', () => {
  const placed = (axis: number, length = 9) => {
    const unit = new Uint8Array(length);
    new DataView(unit.buffer).setFloat64(0, 0.01, true);
    unit[8] = axis;
    return withPart(golden, rawPart('unit', unit), 'HEAD');
  };

  it.each([[0, undefined] as const, [1, 'y'] as const, [2, 'z'] as const])('is %i as %s', async (axis, up) => {
    const capture = await openBytes(placed(axis));
    expect(capture.problem).toBeNull();
    expect(capture.static.up).toBe(up);
    // What is streamed has no report yet.
    expect(await streamedPart(placed(axis), 1000)).toEqual({ ...capture.static, report: null });
  });

  it('is not known where it is none, and the capture is shown', async () => {
    const capture = await openBytes(placed(7));
    expect(capture.problem).toMatch(/points up/);
    expect(capture.static.up).toBeUndefined();
    await expect(openBytes(placed(1, 8))).rejects.toThrow(/size/);
  });
});
