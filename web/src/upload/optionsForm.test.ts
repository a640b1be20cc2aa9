import { expect, test } from 'vitest';
import { DEFAULT_CHOICES, designOf, optionsOf } from './optionsForm';

test('what_is_left_empty_is_the_services_choice', () => {
  const cages = { ...DEFAULT_CHOICES, accuracy: 'cages' } as const;
  expect(optionsOf(cages, 12, true)).toEqual({ frames: 12, coordinates: 'mvc' });
});

test('points_are_off_by_a_thousandth_of_the_diagonal_at_most_where_nobody_chose', () => {
  expect(optionsOf(DEFAULT_CHOICES, 12, true)).toEqual({ frames: 12, coordinates: 'mvc', max_error: 0.001 });
});

test('choices_become_options', () => {
  const choices = { ...DEFAULT_CHOICES, name: ' walk ', frameRate: '29.97', cageVertices: '200', bound: '0.05' };
  expect(optionsOf({ ...choices, accuracy: 'bound' }, 12, false)).toEqual({
    frames: 12,
    coordinates: 'mvc',
    name: 'walk',
    frame_rate: 29.97,
    cage: { vertices: 200 },
    max_error: 0.0005,
  });
  expect(optionsOf({ ...choices, accuracy: 'master' }, 12, true)).toMatchObject({ quality: 'master' });
  expect(optionsOf(choices, 12, true)).not.toHaveProperty('cage');
});

test('a_cage_is_designed_where_it_was_asked_for_and_none_was_given', () => {
  const choices = {
    ...DEFAULT_CHOICES,
    name: 'walk',
    cage: 'motion',
    coordinates: 'green',
    cageVertices: '200',
  } as const;
  expect(designOf(choices, false)).toEqual({ name: 'walk', vertices: 200 });
  expect(designOf({ ...choices, cageGoal: 'error', cageError: '0.2', cageSeconds: '30' }, false)).toEqual({
    name: 'walk',
    mean_error: 0.002,
    time_limit_s: 30,
  });
  expect(designOf(choices, true)).toBeNull();
  expect(designOf(DEFAULT_CHOICES, false)).toBeNull();
  // Its number of vertices is the design's, and so are the coordinates.
  expect(optionsOf(choices, 12, false)).toEqual({ frames: 12, coordinates: 'mvc', name: 'walk', max_error: 0.001 });
  expect(optionsOf(choices, 12, true).coordinates).toBe('green');
});
