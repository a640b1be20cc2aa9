import type { Residual } from '../capture';
import '../workerStarted';
import { addResidual } from '../codec/residual';

/** What the page sends: the residual of a block, frames of it to compute, and when it is needed no more. */
export type ToResidualWorker =
  | { readonly kind: 'block'; readonly block: number; readonly points: number; readonly residual: Residual }
  | { readonly kind: 'frame'; readonly block: number; readonly index: number }
  | { readonly kind: 'forget'; readonly block: number };

/** Offsets of a frame: x y z and one unused number of each point. */
export interface FromResidualWorker {
  readonly block: number;
  readonly index: number;
  readonly offsets: Float32Array;
}

const blocks = new Map<number, { points: number; residual: Residual }>();

self.addEventListener('message', ({ data }: MessageEvent<ToResidualWorker>) => {
  if (data.kind === 'block') blocks.set(data.block, data);
  else if (data.kind === 'forget') blocks.delete(data.block);
  else {
    const held = blocks.get(data.block);
    if (!held) return;
    const offsets = offsetsOf(held.residual, held.points, data.index);
    const answer: FromResidualWorker = { block: data.block, index: data.index, offsets };
    self.postMessage(answer, { transfer: [offsets.buffer] });
  }
});

function offsetsOf(residual: Residual, points: number, index: number): Float32Array<ArrayBuffer> {
  const sums = new Float32Array(3 * points);
  addResidual(residual, index, sums);
  const offsets = new Float32Array(4 * points);
  for (let p = 0; p < points; p++) for (let k = 0; k < 3; k++) offsets[4 * p + k] = sums[3 * p + k];
  return offsets;
}
