import { describe, expect, it } from 'vitest';
import { HEAT } from './colorMap';

/** Relative luminance of an sRGB colour. */
function luminance(color: readonly number[]): number {
  const [r, g, b] = color.map((channel) => (channel / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

describe('colours of the heat map', () => {
  it('become lighter with every step, so that they can be read without colour vision too', () => {
    for (let k = 1; k <= 50; k++) {
      expect(luminance(HEAT.color(k / 50))).toBeGreaterThan(luminance(HEAT.color((k - 1) / 50)));
    }
  });

  it('end where values end, and show what was not measured in grey', () => {
    expect(HEAT.color(-3)).toEqual(HEAT.color(0));
    expect(HEAT.color(7)).toEqual(HEAT.color(1));
    expect(new Set(HEAT.color(NaN)).size).toBe(1);
  });

  it('are the same in the picture and in the colour bar', () => {
    const texels = HEAT.texels(256);
    expect([...texels.slice(0, 3)]).toEqual(HEAT.color(0));
    expect([...texels.slice(-4, -1)]).toEqual(HEAT.color(1));
    expect(HEAT.gradient).toContain(`rgb(${HEAT.color(0).join(' ')})`);
    expect(HEAT.gradient).toContain(`rgb(${HEAT.color(1).join(' ')})`);
  });
});
