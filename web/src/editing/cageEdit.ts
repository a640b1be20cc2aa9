import { displace, type Grip } from './grip';
import { isIdentity, type Motion } from './motion';

/** Frames that an edit is kept over, counted from 0, both ends included. */
export interface FrameRange {
  readonly first: number;
  readonly last: number;
  /** Frames from `first` on over which the edit comes in; it is whole at `first + easeIn`. */
  readonly easeIn: number;
  /** Frames up to `last` over which it goes out. */
  readonly easeOut: number;
}

/** A motion of cage vertices, kept over a range of frames. */
export interface CageEdit {
  readonly id: number;
  /** Vertices that were chosen, and those that follow. */
  readonly grip: Grip;
  /** What happens to them where the edit is whole. */
  readonly motion: Motion;
  readonly range: FrameRange;
  readonly enabled: boolean;
}

/** How much of an edit a frame has, from 0 outside its range to 1: a smoothstep (3t² − 2t³) on either side, above 0 in every frame of the range. */
export function weightAt({ first, last, easeIn, easeOut }: FrameRange, frame: number): number {
  if (frame < first || frame > last) return 0;
  return smoothstep((frame - first + 1) / (easeIn + 1)) * smoothstep((last - frame + 1) / (easeOut + 1));
}

/** A range as it can be in a capture of so many frames: whole frames in order, and easing that leaves at least one frame whole. */
export function fitted(range: FrameRange, frames: number): FrameRange {
  const whole = (value: number, most: number) =>
    Math.min(most, Math.max(0, Number.isFinite(value) ? Math.round(value) : 0));
  const first = whole(range.first, Math.max(0, frames - 1));
  const last = Math.max(first, whole(range.last, Math.max(0, frames - 1)));
  const easeIn = whole(range.easeIn, last - first);
  return { first, last, easeIn, easeOut: whole(range.easeOut, last - first - easeIn) };
}

/**
 * Does edits, one after another, to the rows of a frame, `rowsPerFrame × 3`, whose first rows are the cage's vertices. Rows that no edit changes come back
 * as they are.
 */
export function editedRows(rows: Float32Array, frame: number, edits: readonly CageEdit[]): Float32Array {
  let edited: Float64Array | null = null;
  for (const { grip, motion, range, enabled } of edits) {
    const weight = enabled ? weightAt(range, frame) : 0;
    if (weight > 0) displace((edited ??= Float64Array.from(rows)), grip, motion, weight);
  }
  return edited === null ? rows : Float32Array.from(edited);
}

export function counts({ enabled, motion }: CageEdit): boolean {
  return enabled && !isIdentity(motion);
}

function smoothstep(t: number): number {
  const x = Math.min(1, t);
  return x * x * (3 - 2 * x);
}
