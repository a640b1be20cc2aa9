import { expect, test } from 'vitest';
import { numberAt, numberText, placeOf, rangeText } from './frameNumbers';
import { advanced, standing } from './transport';

const gaps = Float64Array.of(0, 1, 5);

test('a_place_between_frames_has_a_number_between_theirs_and_is_found_by_it', () => {
  for (const [place, number] of [
    [0, 0],
    [0.5, 0.5],
    [1, 1],
    [1.25, 2],
    [2, 5],
    [2.5, 5.5],
  ]) {
    expect(numberAt(gaps, place)).toBe(number);
    expect(placeOf(gaps, number)).toBe(place);
  }
  expect([placeOf(gaps, -3), placeOf(gaps, 9)]).toEqual([0, 3]);
  expect([numberAt(null, 2.5), placeOf(null, 2.5)]).toEqual([2.5, 2.5]);
});

test('the_last_frame_of_a_cache_that_was_sampled_twice_a_frame_is_shown_for_half_a_frame', () => {
  expect(numberAt(Float64Array.of(3, 3.5, 4), 3)).toBe(4.5);
  expect(numberAt(Float64Array.of(7), 1)).toBe(8);
});

test('numbers_are_written_without_needless_digits', () => {
  expect([1005, 0.5, 1 / 3].map(numberText)).toEqual(['1005', '0.5', '0.333']);
});

test('ranges_have_the_numbers_of_their_frames', () => {
  const shot = Float64Array.of(1001, 1002, 1004);
  expect([rangeText(shot, 0, 2), rangeText(shot, 1, 1), rangeText(null, 0, 2)]).toEqual(['1001–1004', '1002', '0–2']);
});

test('frames_that_are_missing_take_their_time', () => {
  const transport = { ...standing(), playing: true, rate: 10, frames: 3, numbers: gaps };
  // From number 1 to number 5 are four frames: at 0.3 s three have passed.
  expect(advanced(transport, 0.3).position).toBeCloseTo(1.5, 9);
  expect(advanced(transport, 0.5).position).toBeCloseTo(2, 9);
  // The whole round is numbers 0 to 6.
  expect(advanced(transport, 0.65).position).toBeCloseTo(0.5, 9);
  expect(advanced({ ...transport, repeat: 'once' }, 0.65)).toMatchObject({ position: 2, playing: false });
});
