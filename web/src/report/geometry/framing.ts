import { boundsOf } from '../../coordinates/topology';
import { HOME, seenFrom, type CameraState, orbited, zoomed } from '../../render/camera';

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

export function pictureShape(positions: Float32Array): number {
  const [right, up] = extents(homeView(positions), positions);
  const shape = right / up;
  return Number.isFinite(shape) ? Math.min(WIDEST, Math.max(NARROWEST, shape)) : 1;
}

const [TURN, STEP] = [Math.PI / 18, 1.12];

/** Where a key takes the camera: arrows turn it, plus and minus bring it nearer and farther; null of other keys. */
export function keyedCamera(camera: CameraState, key: string): CameraState | null {
  switch (key) {
    case 'ArrowLeft':
      return orbited(camera, -TURN, 0);
    case 'ArrowRight':
      return orbited(camera, TURN, 0);
    case 'ArrowUp':
      return orbited(camera, 0, TURN);
    case 'ArrowDown':
      return orbited(camera, 0, -TURN);
    case '+':
    case '=':
      return zoomed(camera, 1 / STEP);
    case '-':
      return zoomed(camera, STEP);
    default:
      return null;
  }
}
