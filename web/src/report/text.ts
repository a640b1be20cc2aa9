/** Figures as the tables of reports have them; a dash stands for what does not exist. */

import type { Figure } from './data';

type Known = Figure | undefined;

const told = (value: Known, text: (value: number) => string) => (typeof value === 'number' ? text(value) : '–');

/** A fraction as a percentage with so many decimals, without the sign. */
export function percents(fraction: Known, decimals: number): string {
  return told(fraction, (x) => (100 * x).toFixed(decimals));
}

/** A fraction as a percentage of any size, without the sign. */
export function anyPercents(fraction: Known): string {
  return told(fraction, (x) => (x < 1 ? percents(x, 4) : (100 * x).toExponential(1)));
}

export function decimals(value: Known, count: number): string {
  return told(value, (x) => x.toFixed(count));
}

export function condition(value: Known): string {
  return told(value, (x) => (x < 1e5 ? x.toFixed(1) : x.toExponential(1)));
}

/** A singular value: four decimals, or a power of ten where it is small. */
export function singular(value: Known): string {
  return told(value, (x) => (x < 1e-3 ? x.toExponential(3) : x.toFixed(4)));
}

/** Seconds in a unit that people read. */
export function seconds(value: Known): string {
  return told(value, (x) => {
    if (x < 1e-3) return `${(1e6 * x).toFixed(1)} µs`;
    return x < 1 ? `${(1e3 * x).toFixed(1)} ms` : `${x.toFixed(2)} s`;
  });
}

export function quoted(word: string): string {
  return /^[\w\-./:@%+=,]+$/.test(word) ? word : `'${word.replaceAll("'", String.raw`'\''`)}'`;
}
