import { SphereCapture } from './sphere';

/** A capture with noise in every frame, which only a residual can follow. */
export class NoisyCapture extends SphereCapture {
  override frames(first: number, count: number): Float32Array<ArrayBuffer> {
    const frames = super.frames(first, count);
    const length = frames.length / count;
    for (let k = 0; k < count; k += 1) {
      let state = first + k + 1;
      for (let at = k * length; at < (k + 1) * length; at += 1) {
        state = (48_271 * state) % 2_147_483_647;
        frames[at] += 3e-3 * (state / 2_147_483_647 - 0.5);
      }
    }
    return frames;
  }
}
