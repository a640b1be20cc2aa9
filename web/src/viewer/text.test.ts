import { expect, test } from 'vitest';
import { fileNameOf } from './text';

test('a_file_name_is_the_last_part_of_its_address_with_its_escapes_decoded', () => {
  expect(fileNameOf('https://example.org/a/long%20walk.cager?v=2#x')).toBe('long walk.cager');
  expect(fileNameOf('walk.cager')).toBe('walk.cager');
  expect(fileNameOf('/50%.cager')).toBe('50%.cager');
  expect(fileNameOf('?id=3')).toBe('?id=3');
});
