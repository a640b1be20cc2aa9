import { expect, test } from 'vitest';
import { type FrameCounts, solvedFromStart, unsolved } from './messages';

const counts = (solved: number, missing: [number, number][], missing_next?: number): FrameCounts => ({
  received: solved,
  solved,
  missing,
  ...(missing_next === undefined ? {} : { missing_next }),
});

test('what_is_left_to_post_are_the_gaps_and_the_end', () => {
  expect(unsolved(counts(0, []), 5)).toEqual([[0, 5]]);
  expect(unsolved(counts(5, []), 5)).toEqual([]);
  expect(unsolved(counts(3, [[1, 2]]), 6)).toEqual([
    [1, 2],
    [4, 6],
  ]);
  expect(unsolved(counts(2, [[0, 4]]), 6)).toEqual([[0, 4]]);
});

test('where_the_gaps_are_not_all_listed_the_rest_is_asked_for_later', () => {
  expect(unsolved(counts(3, [[1, 2]], 9), 100)).toEqual([[1, 2]]);
});

test('frames_are_playable_up_to_the_first_gap', () => {
  expect(solvedFromStart(counts(9, [[4, 5]]))).toBe(4);
  expect(solvedFromStart(counts(9, []))).toBe(9);
});
