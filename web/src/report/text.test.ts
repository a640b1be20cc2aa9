import { describe, expect, it } from 'vitest';
import { anyPercents, condition, percents, quoted, seconds, singular } from './text';

describe('text of a report', () => {
  it('has a dash for what does not exist', () => {
    expect([percents(null, 3), anyPercents(null), condition(null), singular(null), seconds(null)]).toEqual(
      Array(5).fill('–'),
    );
  });

  it('has units that people read', () => {
    expect([seconds(2e-5), seconds(0.0125), seconds(3)]).toEqual(['20.0 µs', '12.5 ms', '3.00 s']);
    expect([condition(20.13), condition(2.5e8), singular(0.25), singular(2e-5)]).toEqual([
      '20.1',
      '2.5e+8',
      '0.2500',
      '2.000e-5',
    ]);
    expect([percents(0.00123, 2), anyPercents(55)]).toEqual(['0.12', '5.5e+3']);
  });

  it('has words that survive a shell', () => {
    expect(quoted('walk/rest.obj')).toBe('walk/rest.obj');
    expect(quoted('walk/*.obj')).toBe("'walk/*.obj'");
    expect(quoted("it's")).toBe(String.raw`'it'\''s'`);
    expect(quoted('')).toBe("''");
  });
});
