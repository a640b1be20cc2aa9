import { boundsOf } from '../../coordinates/topology';
import { HOME, seenFrom, type CameraState } from '../../render/camera';

/** Angle above the horizon. */
const ELEVATION = 0.2;
/** Width over height that pictures keep to. */
const [NARROWEST, WIDEST] = [0.7, 1.6];

/** How far positions, x y z each, reach along the axes of a camera: to the right, upwards and towards it. */
function extents(view: Pick<CameraState, 'azimuth' | 'elevation'>, positions: Float32Array) {
  const { low, high } = boundsOf(seenFrom(view, positions));
  return low.map((least, k) => (high[k] >= least ? high[k] - least : 1));
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
