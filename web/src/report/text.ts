/** Figures as the tables of reports have them; a dash stands for what does not exist. */

import type { Figure } from './data';

const NOTHING = '–';

/** A fraction as a percentage with so many decimals, without the sign. */
export function percents(fraction: Figure, decimals: number): string {
  return fraction === null ? NOTHING : (100 * fraction).toFixed(decimals);
}

/** A fraction as a percentage of any size, without the sign. */
export function anyPercents(fraction: Figure): string {
  if (fraction === null) return NOTHING;
  return fraction < 1 ? percents(fraction, 4) : (100 * fraction).toExponential(1);
}

/** A number with so many decimals. */
export function decimals(value: Figure, count: number): string {
  return value === null ? NOTHING : value.toFixed(count);
}

/** A condition number. */
export function condition(value: Figure): string {
  if (value === null) return NOTHING;
  return value < 1e5 ? value.toFixed(1) : value.toExponential(1);
}

/** A singular value: four decimals, or a power of ten where it is small. */
export function singular(value: Figure): string {
  if (value === null) return NOTHING;
  return value < 1e-3 ? value.toExponential(3) : value.toFixed(4);
}

/** Seconds in a unit that people read. */
export function seconds(value: Figure): string {
  if (value === null) return NOTHING;
  if (value < 1e-3) return `${(1e6 * value).toFixed(1)} µs`;
  return value < 1 ? `${(1e3 * value).toFixed(1)} ms` : `${value.toFixed(2)} s`;
}

/** A word as a shell takes it. */
export function quoted(word: string): string {
  return /^[\w\-./:@%+=,]+$/.test(word) ? word : `'${word.replaceAll("'", String.raw`'\''`)}'`;
}
