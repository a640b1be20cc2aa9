import { expect, test } from 'vitest';
import { age, counted, fileNameOf, percent, perSecond, ratio, size, span } from './text';

test('figures_have_as_many_digits_as_people_need', () => {
  expect(['0', 0.000312, 0.0123, 0.5, 3e-9].map((x) => percent(Number(x), 2))).toEqual([
    '0 %',
    '0.031 %',
    '1.2 %',
    '50 %',
    '3e-7 %',
  ]);
  expect(percent(null)).toBe('–');
  expect([0, 999, 1000, 12_345, 1_234_567, 345_000_000, 2e9].map(size)).toEqual([
    '0 B',
    '999 B',
    '1.0 kB',
    '12 kB',
    '1.2 MB',
    '345 MB',
    '2.0 GB',
  ]);
  expect([3.14159, 38.2, 1204].map(ratio)).toEqual(['3.1×', '38×', '1,204×']);
  expect([0.42, 3.25, 1500].map(perSecond)).toEqual(['0.42 frames/s', '3.3 frames/s', '1,500 frames/s']);
});

test('fractions_of_any_size_are_percentages_of_three_digits', () => {
  expect([0, 0.123456, 0.5, 1.5e-5, 1.2345e-6, 4.5678e-9].map((x) => percent(x))).toEqual([
    '0 %',
    '12.3 %',
    '50 %',
    '0.0015 %',
    '0.000123 %',
    '4.57e-7 %',
  ]);
});

test('a_file_name_is_the_last_part_of_its_address_with_its_escapes_decoded', () => {
  expect(fileNameOf('https://example.org/a/long%20walk.cager?v=2#x')).toBe('long walk.cager');
  expect(fileNameOf('walk.cager')).toBe('walk.cager');
  expect(fileNameOf('/50%.cager')).toBe('50%.cager');
  expect(fileNameOf('?id=3')).toBe('?id=3');
});

test('times_are_told_in_the_units_that_matter', () => {
  expect([0.2, 45, 60, 3599, 7500, 36_000, 100_000, 400_000].map(span)).toEqual([
    '0 s',
    '45 s',
    '1 min',
    '1 h',
    '2 h 5 min',
    '10 h',
    '28 h',
    '5 days',
  ]);
  expect(age(100, 101)).toBe('just now');
  expect(age(0, 600)).toBe('10 min ago');
});

test('one_is_singular', () => {
  expect([counted(1, 'frame'), counted(12_000, 'frame')]).toEqual(['1 frame', '12,000 frames']);
});
