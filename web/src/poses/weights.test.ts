import { expect, test } from 'vitest';
import { cornerOf, polygonWeights, reachable } from './weights';

test('weights_sum_to_one_and_give_the_place_back', () => {
  for (const count of [3, 4, 5, 8]) {
    for (const place of [
      [0, 0],
      [0.3, -0.2],
      [-0.1, 0.55],
      [0.9, 0.4],
    ] as const) {
      const weights = polygonWeights(place, count);
      expect(weights.reduce((a, b) => a + b, 0)).toBeCloseTo(1, 12);
      for (const axis of [0, 1] as const) {
        const back = weights.reduce((sum, weight, k) => sum + weight * cornerOf(k, count)[axis], 0);
        expect(back).toBeCloseTo(place[axis], 9);
      }
    }
  }
});

test('a_corner_is_its_pose_alone_and_the_middle_is_all_alike', () => {
  for (const [k, weight] of polygonWeights(cornerOf(2, 5), 5).entries())
    expect(weight).toBeCloseTo(k === 2 ? 1 : 0, 12);
  for (const weight of polygonWeights([0, 0], 5)) expect(weight).toBeCloseTo(0.2, 12);
  const [a, b, c] = polygonWeights(
    [(cornerOf(0, 3)[0] + cornerOf(1, 3)[0]) / 2, (cornerOf(0, 3)[1] + cornerOf(1, 3)[1]) / 2],
    3,
  );
  expect(a).toBeCloseTo(0.5, 6);
  expect(b).toBeCloseTo(0.5, 6);
  expect(c).toBeCloseTo(0, 6);
});

test('places_that_are_too_far_away_are_drawn_near', () => {
  expect(reachable([0.3, -0.4])).toEqual([0.3, -0.4]);
  expect(Math.hypot(...reachable([5, -9]))).toBeCloseTo(1.05, 12);
  for (const weight of polygonWeights(reachable([3, 3]), 16)) expect(Math.abs(weight)).toBeLessThan(10);
});
