import { expect, test } from 'vitest';
import type { Session } from '../service/messages';
import { isFiltering, matches } from './listParts';

const session = { name: 'Shot 042 hero', id: '01a2', state: 'ready', coordinates: 'harmonic' } as Session;

test('every_word_must_be_somewhere', () => {
  const found = (text: string) => matches(session, { text, state: 'all' });
  expect(['', 'shot', 'HERO 042', '01A2', 'harmonic ready'].map(found)).toEqual([true, true, true, true, true]);
  expect(['villain', 'shot 043'].map(found)).toEqual([false, false]);
  expect(matches({ ...session, name: null }, { text: 'shot', state: 'all' })).toBe(false);
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
