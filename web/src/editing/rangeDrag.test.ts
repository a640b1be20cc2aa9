import { expect, it } from 'vitest';
import { draggedRange, partAt } from './rangeDrag';

const range = { first: 6, last: 20, easeIn: 4, easeOut: 5 };

it('an end that is dragged inwards takes from the ease beside it first, and never passes the other end', () => {
  expect(draggedRange('first', range, 3, 30)).toEqual({ first: 9, last: 20, easeIn: 4, easeOut: 5 });
  expect(draggedRange('first', range, 8, 30)).toEqual({ first: 14, last: 20, easeIn: 1, easeOut: 5 });
  expect(draggedRange('last', range, -90, 30)).toEqual({ first: 6, last: 6, easeIn: 0, easeOut: 0 });
  expect(draggedRange('last', range, 90, 30)).toEqual({ first: 6, last: 29, easeIn: 4, easeOut: 5 });
});

it('eases end within the range and do not overlap', () => {
  expect(draggedRange('easeIn', range, 2, 30).easeIn).toBe(6);
  expect(draggedRange('easeIn', range, 50, 30)).toEqual({ ...range, easeIn: 9 });
  expect(draggedRange('easeOut', range, 3, 30).easeOut).toBe(2);
  expect(draggedRange('easeOut', range, 50, 30).easeOut).toBe(0);
});

it('a whole range keeps its length at both ends of the capture', () => {
  expect(draggedRange('whole', range, -9, 30)).toEqual({ ...range, first: 0, last: 14 });
  expect(draggedRange('whole', range, 99, 30)).toEqual({ ...range, first: 15, last: 29 });
});

it('ends are taken below, eases above, and all of it in between', () => {
  expect(partAt(range, 6.4, false, 1, Number)).toBe('first');
  expect(partAt(range, 19.2, false, 1, Number)).toBe('last');
  expect(partAt(range, 10.4, true, 1, Number)).toBe('easeIn');
  expect(partAt(range, 15, true, 1, Number)).toBe('easeOut');
  expect(partAt(range, 13, false, 1, Number)).toBe('whole');
  expect(partAt(range, 24, false, 1, Number)).toBeNull();
  const short = { first: 5, last: 5, easeIn: 0, easeOut: 0 };
  expect([-3, 2].map((way) => partAt(short, 5, false, 1, Number, way))).toEqual(['first', 'last']);
  expect([partAt(short, 4.8, false, 1, Number), partAt(short, 5.2, false, 1, Number)]).toEqual(['first', 'last']);
});
