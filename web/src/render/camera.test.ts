import { describe, expect, it } from 'vitest';
import {
  blended,
  cameraFromText,
  cameraText,
  cornersOf,
  eyeOf,
  FIELD_OF_VIEW,
  framed,
  HOME,
  nearlySame,
  orbited,
  panned,
  zoomed,
} from './camera';

describe('camera', () => {
  it('survives a link', () => {
    const camera = { target: [0.25, -1.5, 0.031], azimuth: -2.1, elevation: 0.4, distance: 3.75 } as const;
    const read = cameraFromText(cameraText(camera));
    expect(read).not.toBeNull();
    expect(read!.azimuth).toBeCloseTo(camera.azimuth, 2);
    expect(read!.elevation).toBeCloseTo(camera.elevation, 2);
    expect(read!.distance).toBeCloseTo(camera.distance, 3);
    expect(read!.target).toEqual(camera.target);
  });

  it.each(['', '1,2,3', 'a,b,c,d,e,f', '1,2,,4,5,6', '1,2,3,4,5,1e999', ',,,,,'])('takes no link %j', (text) => {
    expect(cameraFromText(text)).toBeNull();
  });

  it('never turns over the top nor through the target', () => {
    expect(orbited(HOME, 0, 99).elevation).toBeLessThan(Math.PI / 2);
    expect(zoomed(HOME, 0).distance).toBeGreaterThan(0);
    expect(cameraFromText('0,0,-5,0,0,0')!.distance).toBeGreaterThan(0);
  });

  it('keeps its distance while it turns', () => {
    const [x, y, z] = eyeOf(orbited(HOME, 1.2, 0.3));
    expect(Math.hypot(x, y, z)).toBeCloseTo(HOME.distance, 12);
  });

  it('pans across the line of sight', () => {
    const moved = panned(HOME, 0.3, -0.2);
    const sight = eyeOf(HOME);
    expect(moved.target.reduce((sum, value, k) => sum + value * sight[k], 0)).toBeCloseTo(0, 12);
  });

  it('frames a box in wide and in narrow pictures, and no farther away than it must', () => {
    const box = { low: [1, -2, 3], high: [1.5, 2, 3.4] };
    for (const aspect of [2, 1, 0.46]) {
      const camera = framed({ ...HOME, azimuth: 0, elevation: 0 }, cornersOf(box), aspect);
      expect(camera.target).toEqual([1.25, 0, 3.2]);
      const nearest = camera.distance - 0.2;
      const needed = Math.max(2, 0.25 / aspect) / Math.tan(FIELD_OF_VIEW / 2);
      expect(nearest).toBeGreaterThan(needed);
      expect(nearest).toBeLessThan(needed * 1.3);
    }
  });

  it('goes the shorter way round and arrives', () => {
    const [from, to] = [
      { ...HOME, azimuth: 3.1 },
      { ...HOME, azimuth: -3.1 },
    ];
    expect(Math.abs(blended(from, to, 0.5).azimuth)).toBeCloseTo(Math.PI, 1);
    expect(nearlySame(blended(from, to, 1), to)).toBe(true);
  });
});
