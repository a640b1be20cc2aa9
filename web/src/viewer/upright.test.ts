import { describe, expect, it } from 'vitest';
import { usualUp } from './upright';

/** Corners of a box this large. */
const box = (...size: readonly number[]) => Float64Array.from([0, 0, 0, ...size]);

describe('the axis that points up', () => {
  it('is the one that the file says, whatever the model looks like', () => {
    expect(usualUp({ up: 'y', rest: box(1.7, 0.3, 1.75) })).toBe('y');
    expect(usualUp({ up: 'z', rest: box(0.6, 1.75, 0.3) })).toBe('z');
  });

  it.each([
    ['a person with arms out, z up', [1.75, 0.3, 1.75], 'z'],
    ['a person with arms down, z up', [0.55, 0.3, 1.75], 'z'],
    ['a person, y up', [0.55, 1.75, 0.3], 'y'],
    ['a person with arms out, y up', [1.75, 1.75, 0.3], 'y'],
    ['a horse that looks along z, y up', [0.6, 1.6, 2.4], 'y'],
    ['a horse that looks along x, y up', [2.4, 1.6, 0.6], 'y'],
    ['a face, y up', [0.2, 0.3, 0.22], 'y'],
    ['a cloth that lies, y up', [1, 0.01, 1], 'y'],
    ['a car, y up', [1.8, 1.4, 4], 'y'],
    ['a point', [0, 0, 0], 'y'],
  ] as const)('of %s is guessed', (_, size, up) => {
    expect(usualUp({ rest: box(...size) })).toBe(up);
  });
});
