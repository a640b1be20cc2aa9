import { describe, expect, it } from 'vitest';
import { heatColor, heatGradient, heatTexels } from './colorMap';

/** Relative luminance of an sRGB colour. */
function luminance(color: readonly number[]): number {
  const [r, g, b] = color.map((channel) => (channel / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

describe('colours of the heat map', () => {
  it('become lighter with every step, so that they can be read without colour vision too', () => {
    for (let k = 1; k <= 50; k++) {
      expect(luminance(heatColor(k / 50))).toBeGreaterThan(luminance(heatColor((k - 1) / 50)));
    }
  });

  it('end where values end, and show what was not measured in grey', () => {
    expect(heatColor(-3)).toEqual(heatColor(0));
    expect(heatColor(7)).toEqual(heatColor(1));
    expect(new Set(heatColor(NaN)).size).toBe(1);
  });

  it('are the same in the picture and in the colour bar', () => {
    const texels = heatTexels(256);
    expect([...texels.slice(0, 3)]).toEqual(heatColor(0));
    expect([...texels.slice(-4, -1)]).toEqual(heatColor(1));
    expect(heatGradient()).toContain(`rgb(${heatColor(0).join(' ')})`);
    expect(heatGradient()).toContain(`rgb(${heatColor(1).join(' ')})`);
  });
});
