import { orbited, zoomed, type CameraState } from '../../render/camera';

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
