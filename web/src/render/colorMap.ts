/** Colours from dark violet over green to yellow whose lightness grows evenly, as sRGB: anchors at equal distances, in the manner of viridis. */
const ANCHORS = anchors([
  '440154',
  '482878',
  '3e4a89',
  '31688e',
  '26828e',
  '1f9e89',
  '35b779',
  '6dcd59',
  'b4de2c',
  'fde725',
]);
/** Pale grey through yellow and orange to dark red, for small pictures of many models: what is right is as light as a model without a map. */
const PALE_ANCHORS = anchors(['dadde1', 'f6e09a', 'f8b25a', 'e77335', 'b82e28', '6a031e']);
/** Blue, pale grey and red, equally dark at both ends, for values on both sides of zero. */
const SIGNED_ANCHORS = anchors(['1f4e96', '7fabd6', 'f1efec', 'ee9a78', 'a3231f']);

type Rgb = [number, number, number];

function anchors(colors: readonly string[]): Rgb[] {
  return colors.map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)) as Rgb);
}

/** sRGB colour, 0 … 255 each, of a value between 0 and 1; what is beyond has the colour of the end, what is not a number is grey. */
export function heatColor(value: number): Rgb {
  return between(ANCHORS, value);
}

/** The map as `count` RGBA texels. */
export function heatTexels(count: number): Uint8Array<ArrayBuffer> {
  return texels(ANCHORS, count);
}

/** The map as a CSS gradient, from left to right. */
export function heatGradient(): string {
  return gradient(ANCHORS);
}

/** The map of small pictures as `count` RGBA texels. */
export function paleTexels(count: number): Uint8Array<ArrayBuffer> {
  return texels(PALE_ANCHORS, count);
}

/** {@link paleTexels} as a CSS gradient. */
export function paleGradient(): string {
  return gradient(PALE_ANCHORS);
}

/** The map of values on both sides of zero, from the largest negative to the largest positive one, as `count` RGBA texels. */
export function signedTexels(count: number): Uint8Array<ArrayBuffer> {
  return texels(SIGNED_ANCHORS, count);
}

/** {@link signedTexels} as a CSS gradient. */
export function signedGradient(): string {
  return gradient(SIGNED_ANCHORS);
}

function between(colors: readonly Rgb[], value: number): Rgb {
  if (Number.isNaN(value)) return [128, 128, 128];
  const place = Math.min(1, Math.max(0, value)) * (colors.length - 1);
  const index = Math.min(colors.length - 2, Math.floor(place));
  const [low, high] = [colors[index], colors[index + 1]];
  const blend = (k: number) => Math.round(low[k] + (high[k] - low[k]) * (place - index));
  return [blend(0), blend(1), blend(2)];
}

function texels(colors: readonly Rgb[], count: number): Uint8Array<ArrayBuffer> {
  const found = new Uint8Array(4 * count);
  for (let k = 0; k < count; k++) found.set([...between(colors, k / (count - 1)), 255], 4 * k);
  return found;
}

function gradient(colors: readonly Rgb[]): string {
  return `linear-gradient(90deg, ${colors.map((color) => `rgb(${color.join(' ')})`).join(', ')})`;
}
