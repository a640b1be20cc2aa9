/** A fraction as a percentage with three digits that count. */
export function percent(fraction: number): string {
  const value = 100 * fraction;
  if (value === 0) return '0 %';
  if (Math.abs(value) < 1e-4) return `${Number(value.toPrecision(3)).toExponential()} %`;
  const digits = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return `${Number(value.toFixed(digits))} %`;
}

/** A number with three digits that count. */
export function threeDigits(value: number): string {
  return String(Number(value.toPrecision(3)));
}

/** A number with its thousands set apart. */
export function grouped(value: number): string {
  return value.toLocaleString('en-US');
}

/** Bytes per second as bits per second. */
export function bitrate(bytesPerSecond: number): string {
  const bits = 8 * bytesPerSecond;
  return bits >= 1e6 ? `${(bits / 1e6).toFixed(bits >= 1e7 ? 0 : 1)} Mbit/s` : `${Math.round(bits / 1e3)} kbit/s`;
}

/** Seconds as minutes, seconds and hundredths. */
export function clock(seconds: number): string {
  const hundredths = Math.max(0, Math.floor(seconds * 100 + 1e-6));
  const two = (value: number) => String(value).padStart(2, '0');
  return `${Math.floor(hundredths / 6000)}:${two(Math.floor(hundredths / 100) % 60)}.${two(hundredths % 100)}`;
}

/** Names of coordinate systems for people. */
export const SYSTEM_NAMES = {
  mvc: 'mean value coordinates',
  harmonic: 'harmonic coordinates',
  green: 'Green coordinates',
  'green-free': 'Green coordinates, free normals',
} as const;

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

/** What went wrong, in one sentence. */
export function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
