import { describe, expect, it } from 'vitest';
import { editedRows, fitted, weightAt, type CageEdit } from './cageEdit';
import type { Motion } from './motion';

const range = { first: 4, last: 12, easeIn: 3, easeOut: 2 };
const grip = { chosen: [1], own: Float64Array.of(0, 1), mirror: null };
const edit: CageEdit = { id: 1, grip, motion: { kind: 'move', by: [1, 2, 3] }, range, enabled: true };

describe('the range of an edit', () => {
  it('comes in, stays whole and goes out without a jump, and touches no other frame', () => {
    const weights = Array.from({ length: 20 }, (_, frame) => weightAt(range, frame));
    expect(weights.map((weight) => weight > 0)).toEqual(weights.map((_, frame) => frame >= 4 && frame <= 12));
    expect(weights.slice(7, 11)).toEqual([1, 1, 1, 1]);
    for (let frame = 4; frame <= 7; frame++) expect(weights[frame]).toBeGreaterThan(weights[frame - 1]);
    for (let frame = 11; frame <= 13; frame++) expect(weights[frame]).toBeLessThan(weights[frame - 1]);
  });

  it('is whole in every frame where nothing eases', () => {
    const plain = { first: 2, last: 3, easeIn: 0, easeOut: 0 };
    expect([1, 2, 3, 4].map((frame) => weightAt(plain, frame))).toEqual([0, 1, 1, 0]);
  });

  it('is made to fit the capture, with at least one whole frame', () => {
    expect(fitted({ first: -5, last: 99, easeIn: 50, easeOut: 50 }, 10)).toEqual({
      first: 0,
      last: 9,
      easeIn: 9,
      easeOut: 0,
    });
    expect(fitted({ first: 7, last: 3, easeIn: NaN, easeOut: 1.4 }, 10)).toEqual({
      first: 7,
      last: 7,
      easeIn: 0,
      easeOut: 0,
    });
    const tight = fitted({ first: 3, last: 9, easeIn: 4, easeOut: 4 }, 10);
    expect(weightAt(tight, tight.first + tight.easeIn)).toBe(1);
  });
});

describe('edited frames', () => {
  it('are displaced by the share that the frame has, and rows behind the vertices stay', () => {
    const rows = Float32Array.of(0, 0, 0, 1, 1, 1, 9, 9, 9);
    expect([...editedRows(rows, 8, [edit])]).toEqual([0, 0, 0, 2, 3, 4, 9, 9, 9]);
    const half = editedRows(rows, 12, [edit]);
    expect(half[3]).toBeCloseTo(1 + weightAt(range, 12), 6);
    expect(editedRows(rows, 3, [edit])).toBe(rows);
    expect(editedRows(rows, 8, [{ ...edit, enabled: false }])).toBe(rows);
  });

  it('add up where edits overlap', () => {
    const rows = new Float32Array(6);
    expect([...editedRows(rows, 8, [edit, { ...edit, id: 2 }])]).toEqual([0, 0, 0, 2, 4, 6]);
  });

  it('are rotated and scaled about the pivot that the chosen vertices have in each frame, and eased along the arc', () => {
    const both = { chosen: [0, 1], own: Float64Array.of(1, 1), mirror: null };
    const turned = (motion: Motion, frame: number, rows: Float32Array) =>
      [...editedRows(rows, frame, [{ ...edit, grip: both, motion }])].map((x) => Number(x.toFixed(6)) + 0);
    const half: Motion = { kind: 'rotate', rotation: [0, 0, 1, 0] };
    expect(turned(half, 8, Float32Array.of(0, 0, 0, 2, 0, 0))).toEqual([2, 0, 0, 0, 0, 0]);
    expect(turned(half, 8, Float32Array.of(5, 5, 1, 5, 9, 1))).toEqual([5, 9, 1, 5, 5, 1]);
    const eased = turned(half, 12, Float32Array.of(-1, 0, 0, 1, 0, 0));
    expect(Math.hypot(eased[3], eased[4])).toBeCloseTo(1, 5);
    expect(Math.atan2(eased[4], eased[3])).toBeCloseTo(Math.PI * weightAt(range, 12), 5);
    const larger: Motion = { kind: 'scale', factors: [4, 1, 1] };
    expect(turned(larger, 8, Float32Array.of(0, 0, 0, 2, 1, 0))).toEqual([-3, 0, 0, 5, 1, 0]);
    expect(turned(larger, 12, Float32Array.of(-1, 0, 0, 1, 0, 0))[3]).toBeCloseTo(4 ** weightAt(range, 12), 5);
  });
});
