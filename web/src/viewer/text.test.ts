import { expect, test } from 'vitest';
import { fileNameOf, percent } from './text';

test('fractions_of_any_size_are_percentages_of_three_digits', () => {
  expect([0, 0.123456, 0.5, 1.5e-5, 1.2345e-6, 4.5678e-9].map(percent)).toEqual([
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
