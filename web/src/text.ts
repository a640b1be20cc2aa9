/** Figures as people read them, and what went wrong. */

export const SYSTEM_NAMES = {
  mvc: 'Mean value',
  harmonic: 'Harmonic',
  green: 'Green',
  'green-free': 'Green, free normals',
} as const;

const NUMBER = new Intl.NumberFormat('en', { maximumFractionDigits: 0 });

/** `12,000`. */
export function count(value: number): string {
  return NUMBER.format(value);
}

/** `1 frame`, `12,000 frames`. */
export function counted(value: number, noun: string): string {
  return `${count(value)} ${noun}${value === 1 ? '' : 's'}`;
}

/** A fraction in per cent, with as many significant digits: `0.031 %`. */
export function percent(fraction: number | null, digits = 3): string {
  if (fraction === null || Number.isNaN(fraction)) return '–';
  const value = 100 * fraction;
  if (value !== 0 && Math.abs(value) < 1e-4) return `${Number(value.toPrecision(digits)).toExponential()} %`;
  return `${Number(decimal(value, digits))} %`;
}

/** A number with three significant digits. */
export function threeDigits(value: number): string {
  return String(Number(value.toPrecision(3)));
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

/** Bytes per second as bits per second. */
export function bitrate(bytesPerSecond: number): string {
  const bits = 8 * bytesPerSecond;
  return bits >= 1e6 ? `${(bits / 1e6).toFixed(bits >= 1e7 ? 0 : 1)} Mbit/s` : `${Math.round(bits / 1e3)} kbit/s`;
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

/** Seconds as minutes, seconds and hundredths. */
export function clock(seconds: number): string {
  const hundredths = Math.max(0, Math.floor(seconds * 100 + 1e-6));
  const two = (value: number) => String(value).padStart(2, '0');
  return `${Math.floor(hundredths / 6000)}:${two(Math.floor(hundredths / 100) % 60)}.${two(hundredths % 100)}`;
}

/** The last part of an address as it is shown to people: escapes are decoded where they can be. */
export function fileNameOf(address: string): string {
  const path = address.split(/[?#]/)[0];
  const name = path.split('/').findLast((part) => part !== '') ?? address;
  try {
    return decodeURIComponent(name);
  } catch {
    return name;
  }
}

/** The address of the service beside the page, for the command line. */
export function serviceAddress(): string {
  return new URL('.', document.baseURI).href.replace(/\/$/, '');
}

/** What went wrong, in one sentence. */
export function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

function decimal(value: number, digits: number): string {
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value) || 1)));
  return value.toFixed(Math.min(places, 12));
}
