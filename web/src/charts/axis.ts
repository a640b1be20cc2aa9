/** Where values lie along an axis, as shares of its length, and where it has lines. */
export interface Axis {
  readonly ends: readonly [number, number];
  readonly ticks: readonly number[];
  place(value: number): number;
  valueAt(share: number): number;
}

/** @param about how many lines there are, roughly */
export function axisOf(ends: readonly [number, number], about: number, isLog = false): Axis {
  const to = (value: number) => (isLog ? Math.log10(value) : value);
  const [first, last] = ends.map(to);
  const span = last - first || 1;
  return {
    ends,
    ticks: about === 0 ? [] : isLog && span > 1 ? powers(first, last, about) : multiples(ends, about),
    place: (value) => (to(value) - first) / span,
    valueAt: (share) => (isLog ? 10 ** (first + share * span) : first + share * span),
  };
}

/** Powers of ten between two exponents; 2 and 5 times these, too, where there are few. */
function powers(first: number, last: number, about: number): number[] {
  const step = Math.max(1, Math.ceil((last - first) / (2 * about)));
  const from = Math.ceil(first / step);
  const found = Array.from({ length: Math.floor(last / step) - from + 1 }, (_, k) => 10 ** (step * (from + k)));
  if (found.length > 2) return found;
  const all = [10 ** (from - 1), ...found].flatMap((power) => [power, 2 * power, 5 * power]);
  return all.filter((value) => Math.log10(value) >= first && Math.log10(value) <= last);
}

/** Multiples of 1, 2 or 5 times a power of ten. */
function multiples([low, high]: readonly [number, number], about: number): number[] {
  const raw = (high - low || 1) / about;
  const unit = 10 ** Math.floor(Math.log10(raw));
  const step = unit * ([1, 2, 5].find((times) => times * unit >= raw) ?? 10);
  const from = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - from + 1;
  return Array.from({ length: Math.max(0, count) }, (_, k) => Number(((from + k) * step).toPrecision(12)));
}
