import { expect, test } from 'vitest';
import type { Session } from '../service/messages';
import { isFiltering, matches, placeOf, viewOf } from './listParts';
import { nameOf } from './row';

const session = { name: 'Shot 042 hero', id: '01a2', state: 'ready', coordinates: 'harmonic' } as Session;

test('every_word_must_be_somewhere', () => {
  const found = (text: string) => matches(session, { text, state: 'all' });
  expect(['', 'shot', 'HERO 042', '01A2', 'harmonic ready'].map(found)).toEqual([true, true, true, true, true]);
  expect(['villain', 'shot 043'].map(found)).toEqual([false, false]);
  expect(matches({ ...session, name: null }, { text: 'shot', state: 'all' })).toBe(false);
});

test('the_address_keeps_what_is_searched_and_the_page', () => {
  const place = { text: 'a & b', state: 'failed', page: 2 } as const;
  expect(placeOf(viewOf(place))).toEqual(place);
  expect(viewOf({ text: '', state: 'all', page: 0 }).toString()).toBe('');
  const odd = new URLSearchParams('state=odd&page=-3');
  expect(placeOf(odd)).toEqual({ text: '', state: 'all', page: 0 });
});

test('coordinates_are_found_by_the_name_that_is_shown', () => {
  expect(matches({ ...session, coordinates: 'mvc' }, { text: 'mean value', state: 'all' })).toBe(true);
});

test('sessions_of_one_minute_without_a_name_are_told_apart', () => {
  const names = ['01a22357aa000001', '01a22357bb000002'].map((id) => nameOf({ ...session, id, name: null }));
  expect(names).toEqual(['Session aa000001', 'Session bb000002']);
});

test('running_is_all_that_is_not_over', () => {
  const states = (['preparing', 'ready', 'completed', 'failed'] as const).map((state) => ({ ...session, state }));
  const found = (state: 'all' | 'running' | 'completed' | 'failed') =>
    states.filter((one) => matches(one, { text: '', state })).map((one) => one.state);
  expect(found('all').length).toBe(4);
  expect(found('running')).toEqual(['preparing', 'ready']);
  expect(found('completed')).toEqual(['completed']);
  expect(found('failed')).toEqual(['failed']);
});

test('blanks_do_not_filter', () => {
  expect(isFiltering({ text: '  ', state: 'all' })).toBe(false);
  expect(isFiltering({ text: '', state: 'failed' })).toBe(true);
});
