import type { Capture } from '../capture';
import { canCompute } from '../coordinates/compute';
import { computePhi } from '../coordinates/pool';

/** Whether Φ comes from the service, since the page does not compute it. */
export function isFetched(capture: Capture): boolean {
  return !canCompute(capture.static.system) && capture.coordinates !== undefined;
}

/** Φ of a capture, from wherever it comes. */
export function phiOf(
  capture: Capture,
  onProgress: (fraction: number) => void,
  signal: AbortSignal,
): Promise<Float32Array> {
  if (isFetched(capture)) return capture.coordinates!(onProgress, signal);
  return capture.phi?.(onProgress, signal) ?? computePhi(capture.static, { signal, onProgress });
}
