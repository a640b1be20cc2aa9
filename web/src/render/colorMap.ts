/** Colours from dark violet over green to yellow whose lightness grows evenly, as sRGB: anchors at equal distances, in the manner of viridis. */
const ANCHORS = [
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
].map(
  (hex): [number, number, number] =>
    [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)) as [number, number, number],
);

/** sRGB colour, 0 … 255 each, of a value between 0 and 1; what is beyond has the colour of the end, what is not a number is grey. */
export function heatColor(value: number): [number, number, number] {
  if (Number.isNaN(value)) return [128, 128, 128];
  const place = Math.min(1, Math.max(0, value)) * (ANCHORS.length - 1);
  const index = Math.min(ANCHORS.length - 2, Math.floor(place));
  const [low, high] = [ANCHORS[index], ANCHORS[index + 1]];
  const blend = (k: number) => Math.round(low[k] + (high[k] - low[k]) * (place - index));
  return [blend(0), blend(1), blend(2)];
}

/** The map as `count` RGBA texels. */
export function heatTexels(count: number): Uint8Array<ArrayBuffer> {
  const texels = new Uint8Array(4 * count);
  for (let k = 0; k < count; k++) texels.set([...heatColor(k / (count - 1)), 255], 4 * k);
  return texels;
}

/** The map as a CSS gradient, from left to right. */
export function heatGradient(): string {
  return `linear-gradient(90deg, ${ANCHORS.map((color) => `rgb(${color.join(' ')})`).join(', ')})`;
}
