import { axesOf, FIELD_OF_VIEW, HOME, type CameraState } from '../../render/camera';

/** How much larger than what is shown a picture is. */
const ROOM = 1.15;
/** Angle above the horizon. */
const ELEVATION = 0.2;
/** Width over height that pictures keep to. */
const [NARROWEST, WIDEST] = [0.7, 1.6];

/** Where positions, x y z each, end along the axes of a camera: to the right, upwards and towards it. */
function extents(view: Pick<CameraState, 'azimuth' | 'elevation'>, positions: Float32Array) {
  const { right, up, back } = axesOf(view);
  return [right, up, back].map((axis) => {
    let [low, high] = [Infinity, -Infinity];
    for (let k = 0; k < positions.length; k += 3) {
      const along = positions[k] * axis[0] + positions[k + 1] * axis[1] + positions[k + 2] * axis[2];
      low = Math.min(low, along);
      high = Math.max(high, along);
    }
    return { axis, middle: high >= low ? (low + high) / 2 : 0, reach: high >= low ? (high - low) / 2 : 0.5 };
  });
}

/** Looks at positions from the side that shows most of them, turned a little. */
export function homeView(positions: Float32Array): Pick<CameraState, 'azimuth' | 'elevation'> {
  const [x, , z] = extents({ azimuth: 0, elevation: 0 }, positions);
  return { azimuth: x.reach >= z.reach ? 0.5 : Math.PI / 2 - 0.5, elevation: ELEVATION };
}

/** Width over height of a picture that suits positions. */
export function pictureShape(positions: Float32Array): number {
  const [right, up] = extents(homeView(positions), positions);
  const shape = right.reach / up.reach;
  return Number.isFinite(shape) ? Math.min(WIDEST, Math.max(NARROWEST, shape)) : 1;
}

/** Moves a camera, without turning it, to where positions fill a picture whose width is `aspect` times its height. */
export function fitted(
  view: Pick<CameraState, 'azimuth' | 'elevation'>,
  positions: Float32Array,
  aspect: number,
): CameraState {
  const [right, up, back] = extents(view, positions);
  const across = Math.max(up.reach, right.reach / aspect);
  const target = [0, 1, 2].map((k) => [right, up, back].reduce((sum, { axis, middle }) => sum + middle * axis[k], 0));
  const distance = (ROOM * across) / Math.tan(FIELD_OF_VIEW / 2) + back.reach;
  return { ...HOME, ...view, target: target as [number, number, number], distance };
}
