/** Figures as people read them. */

const NUMBER = new Intl.NumberFormat('en', { maximumFractionDigits: 0 });

export function count(value: number): string {
  return NUMBER.format(value);
}

/** `1 frame`, `12,000 frames`. */
export function counted(value: number, noun: string): string {
  return `${count(value)} ${noun}${value === 1 ? '' : 's'}`;
}

/** A fraction of the diagonal in per cent, with two significant digits: `0.031 %`. */
export function fraction(value: number | null): string {
  if (value === null || Number.isNaN(value)) return '–';
  if (value === 0) return '0 %';
  const percent = 100 * value;
  return percent < 1e-5 ? `${percent.toExponential(0)} %` : `${decimal(percent, 2)} %`;
}

/** `3.4 MB`, in powers of ten as file managers have them. */
export function size(bytes: number): string {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  const unit = bytes < 1 ? 0 : Math.min(units.length - 1, Math.floor(Math.log10(bytes) / 3));
  const value = bytes / 1000 ** unit;
  return `${unit === 0 ? count(value) : decimal(value, value < 100 ? 2 : 3)} ${units[unit]}`;
}

/** `38×`. */
export function ratio(value: number): string {
  return `${value < 10 ? value.toFixed(1) : count(value)}×`;
}

/** `12 frames/s`, `0.4 frames/s`. */
export function perSecond(value: number): string {
  return `${value < 10 ? decimal(value, 2) : count(value)} frames/s`;
}

/** A span of time in its two largest units or less: `45 s`, `3 min`, `2 h 5 min`, `4 days`. */
export function span(seconds: number): string {
  if (seconds < 59.5) return `${Math.max(0, Math.round(seconds))} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 60) return `${minutes} min`;
  const hours = Math.floor(minutes / 60);
  if (hours < 10) return minutes % 60 === 0 ? `${hours} h` : `${hours} h ${minutes % 60} min`;
  return minutes < 48 * 60 ? `${Math.round(minutes / 60)} h` : `${Math.round(minutes / 60 / 24)} days`;
}

/** How long ago, as of `now`, both in seconds since 1970. */
export function age(created: number, now: number): string {
  const seconds = now - created;
  return seconds < 5 ? 'just now' : `${span(seconds)} ago`;
}

/** A point in time with its date, for tooltips. */
export function moment(created: number): string {
  return new Date(1000 * created).toLocaleString(undefined, { dateStyle: 'medium', timeStyle: 'medium' });
}

function decimal(value: number, digits: number): string {
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value) || 1)));
  return value.toFixed(Math.min(places, 12));
}
