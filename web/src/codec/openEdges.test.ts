import { expect, it } from 'vitest';
import { randomNumbers } from '../../tests/support/containers';
import { OpenEdges } from './openEdges';

it('a long list does what a short one does', () => {
  const random = randomNumbers(4);
  const plain: number[] = [];
  const edges = new OpenEdges();
  let longest = 0;
  for (let step = 0; step < 2400; step++) {
    const end = random(200);
    // Grows to many more than a plain list holds, then shrinks.
    if (random(4) < (step < 1200 ? 3 : 1)) {
      plain.push(end);
      edges.add(end);
    } else {
      const at = plain.lastIndexOf(end);
      expect(edges.remove(end)).toBe(at >= 0);
      if (at >= 0) plain.splice(at, 1);
    }
    longest = Math.max(longest, plain.length);
    expect(edges.newest()).toEqual(plain.slice(-16));
    expect(edges.has(end)).toBe(plain.includes(end));
  }
  expect(longest).toBeGreaterThan(500);
});
