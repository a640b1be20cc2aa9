import { describe, expect, it } from 'vitest';
import { RestPose, joined, scaleTop } from './modelInCage';

const base64 = (values: ArrayBufferView) =>
  Buffer.from(values.buffer, values.byteOffset, values.byteLength).toString('base64');

/** Two points, at the origin and at (2, 4, 6), whose diagonal is said to be 2. */
function restPose(up: 'x' | 'y' | 'z') {
  return new RestPose({
    mesh: {
      of: 2,
      diagonal: 2,
      up,
      points: { low: [0, 0, 0], step: 2, bits: 8, data: base64(Uint8Array.of(0, 0, 0, 1, 2, 3)) },
      triangles: '',
    },
    cage: { vertices: base64(Float32Array.of(1, 2, 3)), triangles: '' },
  });
}

describe('the rest pose of a report', () => {
  it('stands upright around the origin, in diagonals', () => {
    expect([...restPose('y').points]).toEqual([-0.5, -1, -1.5, 0.5, 1, 1.5]);
    expect([...restPose('z').points]).toEqual([-0.5, -1.5, 1, 0.5, 1.5, -1]);
    expect([...restPose('x').points]).toEqual([-1.5, -0.5, -1, 1.5, 0.5, 1]);
    expect([...restPose('z').cageVertices].map(Math.abs)).toEqual([0, 0, 0]);
  });

  it('turns vectors without moving them', () => {
    const vectors = { low: [0, 0, 0], step: 2, bits: 8, data: base64(Uint8Array.of(1, 2, 3)) } as const;
    expect([...restPose('z').vectorsFrom(vectors)]).toEqual([1, 3, -2]);
  });
});

it('positions are joined in their order', () => {
  expect([...joined([Float32Array.of(1, 2, 3), new Float32Array(0), Float32Array.of(4, 5, 6)])]).toEqual([
    1, 2, 3, 4, 5, 6,
  ]);
  expect(joined([]).length).toBe(0);
});

describe('the top of a colour scale', () => {
  it('is not set by a spike, nor by nothing', () => {
    expect(scaleTop([new Float32Array(1000).fill(0.5).fill(1e6, 0, 3)])).toBe(0.5);
    expect(scaleTop([Float32Array.of(1, NaN), Float32Array.of(Infinity, 3)])).toBe(1);
    expect(scaleTop([])).toBe(1);
    expect(scaleTop([new Float32Array(4)])).toBe(1);
  });
});
