import { axesOf, HOME, type CameraState } from '../../render/camera';

/** Angle above the horizon. */
const ELEVATION = 0.2;
/** Width over height that pictures keep to. */
const [NARROWEST, WIDEST] = [0.7, 1.6];

/** How far positions, x y z each, reach along the axes of a camera: to the right, upwards and towards it. */
function extents(view: Pick<CameraState, 'azimuth' | 'elevation'>, positions: Float32Array) {
  const { right, up, back } = axesOf(view);
  return [right, up, back].map((axis) => {
    let [low, high] = [Infinity, -Infinity];
    for (let k = 0; k < positions.length; k += 3) {
      const along = positions[k] * axis[0] + positions[k + 1] * axis[1] + positions[k + 2] * axis[2];
      low = Math.min(low, along);
      high = Math.max(high, along);
    }
    return high >= low ? high - low : 1;
  });
}

/** Looks at positions from the side that shows most of them, turned a little. */
export function homeView(positions: Float32Array): CameraState {
  const [x, , z] = extents({ azimuth: 0, elevation: 0 }, positions);
  return { ...HOME, azimuth: x >= z ? 0.5 : Math.PI / 2 - 0.5, elevation: ELEVATION };
}

/** Width over height of a picture that suits positions. */
export function pictureShape(positions: Float32Array): number {
  const [right, up] = extents(homeView(positions), positions);
  const shape = right / up;
  return Number.isFinite(shape) ? Math.min(WIDEST, Math.max(NARROWEST, shape)) : 1;
}
