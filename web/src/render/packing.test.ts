import { describe, expect, it } from 'vitest';
import { compacted, expanded, layoutOf, packPhi, WIDTH } from './packing';

describe('entries in 16 bits', () => {
  it('survive there and back, all of them', () => {
    for (let integer = -32767; integer <= 32767; integer += 31) {
      expect(compacted(expanded(integer, 0.8), 0.8)).toBe(integer);
    }
  });

  it('are finer where entries are smaller', () => {
    const errorAt = (value: number) => Math.abs(expanded(compacted(value, 1), 1) - value);
    for (let k = 1; k < 1000; k++) {
      const value = k / 1000.3;
      expect(errorAt(value)).toBeLessThanOrEqual(1.01 * (Math.sqrt(value) / 32767 + 32767 ** -2));
      expect(expanded(compacted(-value, 1), 1)).toBe(-expanded(compacted(value, 1), 1));
    }
  });

  it('are zero where all are', () => {
    expect(compacted(0, 0)).toBe(0);
    expect(expanded(0, 0)).toBe(0);
  });
});

describe('Φ in a texture', () => {
  const limits = { size: 2048, layers: 256 };

  it('is tiled over layers above the texture limit', () => {
    const layout = layoutOf(200_000, 330, limits);
    expect(layout.height).toBeLessThanOrEqual(limits.size);
    expect(layout.layers * layout.bandsPerLayer * WIDTH).toBeGreaterThanOrEqual(200_000);
    expect(layout.layers).toBeGreaterThan(1);
  });

  it('that is too large is refused with what to do', () => {
    expect(() => layoutOf(3_000_000, 9000, limits)).toThrow(/coarser cage/);
  });

  it('that would take more than a gigabyte is refused though the device could arrange it', () => {
    const large = { size: 16_384, layers: 2048 };
    expect(() => layoutOf(1_000_000, 400, large)).toThrow(/coarser cage/);
    expect(layoutOf(1_000_000, 250, large).layers).toBeGreaterThan(1);
  });

  it('holds every entry where the layout says', async () => {
    const [points, columns] = [2 * WIDTH + 7, 6];
    const phi = Float32Array.from({ length: points * columns }, (_, k) => (k % 97) / 64);
    const layout = layoutOf(points, columns, { size: 1024, layers: 4 });
    const tiled = { ...layout, bandsPerLayer: 1, height: 2, layers: 3 };
    const { texels, scale, error } = await packPhi(phi, columns, 0.1, tiled);
    expect(texels).toBeInstanceOf(Int16Array);
    expect(error).toBeLessThan(1e-4);
    for (const [i, column] of [
      [0, 0],
      [WIDTH - 1, 5],
      [WIDTH, 3],
      [points - 1, 4],
    ]) {
      const layer = Math.floor(i / WIDTH);
      const texel = (layer * 2 + Math.floor(column / 4)) * WIDTH + (i % WIDTH);
      expect(expanded(texels[4 * texel + (column % 4)], scale)).toBeCloseTo(phi[i * columns + column], 4);
    }
  });

  it('is kept in full floats where 16 bits would move points too far', async () => {
    const columns = 8;
    const phi = Float32Array.from({ length: columns }, (_, k) => 12.55 * Math.sin(k + 1));
    const packed = await packPhi(phi, columns, 0.5, layoutOf(1, columns, limits));
    expect(packed.texels).toBeInstanceOf(Float32Array);
    expect(packed.texels[4 * WIDTH + 1]).toBe(phi[5]);
  });
});
