import { expect, it } from 'vitest';
import { angle, halfAngleOverSine, SMALL_ANGLE_COSINE } from './angle';

it('is the arc tangent over the half circle, to rounding', () => {
  let worst = 0;
  for (let k = 0; k <= 100_000; k++) {
    const turn = (Math.PI * k) / 100_000;
    for (const radius of [1, 3e-9, 7e5]) {
      const [s, c] = [radius * Math.abs(Math.sin(turn)), radius * Math.cos(turn)];
      worst = Math.max(worst, Math.abs(angle(s, c) - Math.atan2(s, c)));
    }
  }
  expect(worst).toBeLessThan(1e-15);
});

it('is right on the axes, and undefined only where there is no direction', () => {
  expect(angle(0, 2)).toBe(0);
  expect(angle(0, -2)).toBe(Math.PI);
  expect(angle(2, 0)).toBe(Math.PI / 2);
  expect(angle(0, 0)).toBeNaN();
});

it('of small angles is half of what is divided by the sine, to rounding', () => {
  const largest = Math.acos(SMALL_ANGLE_COSINE);
  let worst = 0;
  for (let k = 1; k <= 100_000; k++) {
    const turn = (largest * k) / 100_000;
    const expected = turn / (2 * Math.sin(turn));
    worst = Math.max(worst, Math.abs(halfAngleOverSine(Math.sin(turn) ** 2) - expected));
  }
  expect(worst).toBeLessThan(4e-16);
  expect(halfAngleOverSine(0)).toBe(0.5);
});
