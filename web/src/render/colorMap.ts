type Rgb = [number, number, number];

/** sRGB colours of values between 0 and 1, as anchors at equal distances with straight lines between. */
export class ColorMap {
  private readonly anchors: readonly Rgb[];

  constructor(...colors: readonly string[]) {
    this.anchors = colors.map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)) as Rgb);
  }

  /** 0 … 255 each; what is beyond has the colour of the end, what is not a number is grey. */
  color(value: number): Rgb {
    if (Number.isNaN(value)) return [128, 128, 128];
    const { anchors } = this;
    const place = Math.min(1, Math.max(0, value)) * (anchors.length - 1);
    const index = Math.min(anchors.length - 2, Math.floor(place));
    const [low, high] = [anchors[index], anchors[index + 1]];
    const blend = (k: number) => Math.round(low[k] + (high[k] - low[k]) * (place - index));
    return [blend(0), blend(1), blend(2)];
  }

  texels(count: number): Uint8Array<ArrayBuffer> {
    const found = new Uint8Array(4 * count);
    for (let k = 0; k < count; k++) found.set([...this.color(k / (count - 1)), 255], 4 * k);
    return found;
  }

  get gradient(): string {
    return `linear-gradient(90deg, ${this.anchors.map((color) => `rgb(${color.join(' ')})`).join(', ')})`;
  }
}

/** Dark violet over green to yellow, whose lightness grows evenly, in the manner of viridis. */
export const HEAT = new ColorMap(
  ...['440154', '482878', '3e4a89', '31688e', '26828e', '1f9e89', '35b779', '6dcd59', 'b4de2c', 'fde725'],
);
/** Pale grey through yellow and orange to dark red, for small pictures of many models: what is right is as light as a model without a map. */
export const PALE = new ColorMap('dadde1', 'f6e09a', 'f8b25a', 'e77335', 'b82e28', '6a031e');
/** Blue, pale grey and red, equally dark at both ends, for values on both sides of zero. */
export const SIGNED = new ColorMap('1f4e96', '7fabd6', 'f1efec', 'ee9a78', 'a3231f');
