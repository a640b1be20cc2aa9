import { describe, expect, it } from 'vitest';
import { Quality } from './quality';

function after(quality: Quality, seconds: number, picture: number): number {
  for (let time = 0; time < seconds; time += picture) quality.measure(picture);
  return quality.moving;
}

describe('Quality', () => {
  it('knows no rate before something was drawn', () => {
    const quality = new Quality();
    expect(quality.picturesPerSecond).toBe(0);
    quality.measure(0.05);
    expect(quality.picturesPerSecond).toBeCloseTo(20, 5);
  });

  it('stays at the finest where pictures come in time', () => {
    expect(after(new Quality(), 5, 1 / 60)).toBe(1);
  });

  it('becomes coarser step by step on a slow device, within bounds', () => {
    const quality = new Quality();
    expect(after(quality, 1, 0.1)).toBeLessThan(1);
    const coarsest = after(quality, 60, 0.5);
    expect(coarsest).toBeGreaterThan(0.3);
    expect(quality.picturesPerSecond).toBeCloseTo(2, 1);
  });

  it('tries finer pictures again, and does not mind a single slow one', () => {
    const quality = new Quality();
    after(quality, 2, 0.1);
    expect(after(quality, 10, 1 / 60)).toBe(1);
    quality.measure(0.1);
    expect(after(quality, 2, 1 / 60)).toBe(1);
  });
});
