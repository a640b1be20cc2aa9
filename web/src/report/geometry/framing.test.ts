import { describe, expect, it } from 'vitest';
import { axesOf, eyeOf, FIELD_OF_VIEW, framed } from '../../render/camera';
import { homeView, pictureShape } from './framing';

/** Corners of a box around a point. */
function corners([x, y, z]: readonly number[], width: number, height: number, depth: number): Float32Array {
  const signs = [-0.5, 0.5];
  return Float32Array.from(
    signs.flatMap((a) => signs.flatMap((b) => signs.flatMap((c) => [x + a * width, y + b * height, z + c * depth]))),
  );
}

describe('the camera of a group of views', () => {
  it.each([
    [2, 1, 0.3],
    [0.2, 3, 0.2],
    [0.1, 0.1, 5],
  ])('shows all of a box of %d × %d × %d', (width, height, depth) => {
    const positions = corners([4, -2, 1], width, height, depth);
    const aspect = pictureShape(positions);
    const camera = framed(homeView(positions), positions, aspect);
    const [eye, { right, up, back }] = [eyeOf(camera), axesOf(camera)];
    const slope = Math.tan(FIELD_OF_VIEW / 2);
    let most = 0;
    for (let k = 0; k < positions.length; k += 3) {
      const seen = [right, up, back].map((axis) =>
        axis.reduce((sum, a, i) => sum + a * (positions[k + i] - eye[i]), 0),
      );
      const height = -seen[2] * slope;
      most = Math.max(most, Math.abs(seen[1]) / height, Math.abs(seen[0]) / height / aspect);
    }
    expect(most).toBeLessThan(1);
    expect(most).toBeGreaterThan(0.6);
  });

  it('looks from somewhere at nothing, too', () => {
    const camera = framed(homeView(new Float32Array(0)), new Float32Array(0), 1);
    expect(eyeOf(camera).every(Number.isFinite)).toBe(true);
    expect(pictureShape(new Float32Array(0))).toBe(1);
  });
});
