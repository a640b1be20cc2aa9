import { describe, expect, it } from 'vitest';
import { coordinates, floats, indices } from './numbers';

const base64 = (values: ArrayBufferView) =>
  Buffer.from(values.buffer, values.byteOffset, values.byteLength).toString('base64');

describe('numbers of a report', () => {
  it('are single precision', () => {
    expect([...floats(base64(Float32Array.of(1.5, -2, 1e-30)))]).toEqual([1.5, -2, Math.fround(1e-30)]);
    expect(floats('')).toHaveLength(0);
  });

  it('that name vertices take as many bytes as they need', () => {
    expect([...indices(base64(Uint16Array.of(0, 65_535)), 65_536)]).toEqual([0, 65_535]);
    expect([...indices(base64(Uint32Array.of(0, 65_536)), 65_537)]).toEqual([0, 65_536]);
  });

  it('that are quantised lie on a grid', () => {
    const low = [-1, 0, 2] as const;
    const step = 0.5;
    expect([...coordinates({ low, step, bits: 8, data: base64(Uint8Array.of(0, 1, 255)) })]).toEqual([-1, 0.5, 129.5]);
    expect([...coordinates({ low, step, bits: 16, data: base64(Uint16Array.of(2, 0, 4)) })]).toEqual([0, 0, 4]);
  });
});
