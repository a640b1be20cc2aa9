import type { Capture } from '../capture';
import type { Transport } from './transport';

/**
 * Leaves residual layers out once a capture that plays arrives more slowly than it is played, and has them added when it stands.
 */
export function followBandwidth({ residuals, frameBytes, frames }: Capture, { playing, rate, speed }: Transport) {
  if (!residuals) return;
  if (!playing) {
    if (residuals.leftOut) residuals.leftOut = false;
  } else if (residuals.bytesPerSecond !== null && frameBytes !== undefined && frames > 0) {
    if (residuals.bytesPerSecond < (frameBytes / frames) * rate * speed) residuals.leftOut = true;
  }
}
