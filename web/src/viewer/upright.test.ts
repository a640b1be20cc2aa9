import { describe, expect, it } from 'vitest';
import { usualUp } from './upright';

/** Corners of a box this large. */
const box = (...size: readonly number[]) => Float64Array.from([0, 0, 0, ...size]);
/** A box around 0 that begins at this height. */
const onGround = (up: 'y' | 'z', size: readonly number[], height = 0) => {
  const corner = size.map((length, axis) => (axis === 'xyz'.indexOf(up) ? height : -length / 2));
  return Float64Array.from([...corner, ...corner.map((low, axis) => low + size[axis])]);
};

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

  it.each([
    ['a person who looks along x', [0.37, 0.73, 1.7], 'z'],
    ['a horse', [0.6, 2.4, 2.1], 'z'],
    ['a lion', [0.65, 2.4, 1.1], 'z'],
    ['a car', [1.85, 1.45, 4.8], 'y'],
    ['an aircraft', [35, 12, 37], 'y'],
  ] as const)('of %s is the one that it stands along', (_, size, up) => {
    expect(usualUp({ rest: onGround(up, size) })).toBe(up);
    expect(usualUp({ rest: onGround(up, size, 0.03) })).toBe(up);
    const origin = Float64Array.of(4e5, 5e6, 300);
    expect(usualUp({ rest: onGround(up, [1, 1, 1]), origin })).toBe('y');
  });
});
