import { expect, test } from 'vitest';
import { fileName } from './save';

test('names_of_files_keep_all_that_file_systems_take', () => {
  expect(fileName('Ärm 腕 🦾.cager')).toBe('Ärm 腕 🦾.cager');
  expect(fileName('a/b: "c".png')).toBe('a-b- -c-.png');
});
