import type { FrameBlock, Capture } from '../capture';
import { boundsOf } from '../coordinates/topology';
import { errorsOf } from '../originals/pointErrors';
import type { Decoder } from './decoder';
import { meanOf } from './packing';

/** Points of the model whose ways stand for those of all. */
const SAMPLES = 192;
/** Points that these are chosen from. */
const CANDIDATES = 8192;

/** Where the model is in one frame: a box around the samples, low x y z and high x y z, their mean, and the samples. In diagonals and the model's axes. */
interface Extent {
  readonly box: readonly number[];
  readonly mean: readonly number[];
  readonly positions: Float32Array;
}

/**
 * Where the model goes in the frames that are known. Each frame is decoded for a sample of the model's points, farthest-point samples of the rest pose: the ends
 * of limbs are among them whatever the pose. Cages would not do: solved vertices lie far outside of the model where the capture cannot tell where they are.
 * Residuals are left out; whoever frames the motion leaves more room than they take.
 */
export class Motion {
  onGrowth: () => void = () => undefined;
  private readonly samples: Uint32Array;
  /** Rows of Φ of the samples; null before Φ is there. */
  private weights: Float32Array | null = null;
  private isCageAlone = false;
  /** How far the rest pose goes below its samples along the y and the z axis, in diagonals. */
  private readonly belowSamples: readonly [number, number];
  /** What has come before Φ. */
  private waiting: FrameBlock[] = [];
  private readonly extents: (Extent | undefined)[] = [];
  private usual: number | null = null;

  /** @param rowsPerFrame of the capture, whose rest pose has points at `rest` */
  constructor(
    private readonly rowsPerFrame: number,
    private readonly cageVertices: number,
    rest: ArrayLike<number>,
    private readonly decoder: Pick<Decoder, 'columns' | 'valuesOf' | 'place'>,
  ) {
    this.samples = farthestPoints(rest, SAMPLES);
    const lows = new Float32Array(6).fill(Infinity);
    const sampled = new Set(this.samples);
    for (let at = 0; at < rest.length; at++) {
      const [point, axis] = [Math.floor(at / 3), at % 3];
      lows[axis] = Math.min(lows[axis], rest[at]);
      if (sampled.has(point)) lows[3 + axis] = Math.min(lows[3 + axis], rest[at]);
    }
    decoder.place(lows);
    this.belowSamples = [lows[1] - lows[4], lows[2] - lows[5]];
  }

  /** Takes Φ, points × columns; null where it cannot be had: the cages alone are shown then. */
  setPhi(phi: Float32Array | null) {
    const { columns } = this.decoder;
    this.isCageAlone = phi === null;
    this.weights = phi && new Float32Array(this.samples.length * columns);
    for (const [k, point] of this.samples.entries())
      this.weights?.set(phi!.subarray(point * columns, (point + 1) * columns), k * columns);
    this.extents.length = 0;
    for (const block of this.waiting.splice(0)) this.include(block);
  }

  include(block: FrameBlock) {
    if (!this.weights && !this.isCageAlone) {
      this.waiting.push({ ...block, residual: null });
      return;
    }
    this.usual = null;
    const width = 3 * this.rowsPerFrame;
    for (let k = 0; k < block.count; k++) {
      const positions = this.decoded(block.cages.subarray(k * width, (k + 1) * width));
      this.decoder.place(positions);
      this.extents[block.first + k] = extentOf(positions);
    }
    this.onGrowth();
  }

  /** Whether it is known where the model is in a frame, or will be as soon as Φ is there. */
  knows(frame: number): boolean {
    return (
      this.extents[frame] !== undefined ||
      this.waiting.some(({ first, count }) => frame >= first && frame < first + count)
    );
  }

  get isEmpty(): boolean {
    return this.extents.length === 0;
  }

  /** The lowest place of the model in all frames along the y and the z axis, in diagonals: as far below the samples as it is at rest. */
  get lowest(): readonly [number, number] {
    const of = (axis: number) =>
      this.extents.reduce((lowest, extent) => Math.min(lowest, extent?.box[axis] ?? Infinity), Infinity);
    const [y, z] = this.isCageAlone ? [0, 0] : this.belowSamples;
    return [of(1) + y, of(2) + z];
  }

  /** Corners of the boxes of all frames, x y z each; with a reach, relative to {@link centreAt}. */
  corners(followReach: number | null): Float64Array {
    const corners: number[] = [];
    for (const [frame, extent] of this.extents.entries()) {
      if (!extent) continue;
      const centre = followReach === null ? [0, 0, 0] : this.centreAt(frame, followReach);
      for (let corner = 0; corner < 8; corner++)
        for (let k = 0; k < 3; k++) corners.push(extent.box[corner & (1 << k) ? 3 + k : k] - centre[k]);
    }
    return Float64Array.from(corners);
  }

  /** Where the middle of the model is at a place, a mean over `reach` frames before and after it in which near ones count more. */
  centreAt(position: number, reach: number): [number, number, number] {
    const sum: [number, number, number] = [0, 0, 0];
    // As many on either side, so that it neither runs ahead at the beginning nor lags at the end.
    const near = Math.max(1, Math.min(reach, position + 1, this.extents.length - position));
    let total = 0;
    for (let frame = Math.max(0, Math.ceil(position - near)); frame <= position + near; frame++) {
      const extent = this.extents[frame];
      const weight = near - Math.abs(frame - position);
      if (!extent || weight <= 0) continue;
      total += weight;
      for (let k = 0; k < 3; k++) sum[k] += weight * extent.mean[k];
    }
    return total > 0 ? [sum[0] / total, sum[1] / total, sum[2] / total] : sum;
  }

  /** How far points move from one frame to another, as 99 of 100 do at the most, in diagonals; 0 where one of them is not known. */
  usualMove(from: number, to: number): number {
    return errorsOf(Float32Array.from(this.moves(from, to))).usual;
  }

  /** The same from each frame that is known to the next. */
  get usualMoves(): number {
    this.usual ??= errorsOf(Float32Array.from(this.extents.flatMap((_, frame) => this.moves(frame, frame + 1)))).usual;
    return this.usual;
  }

  private moves(from: number, to: number): number[] {
    const [here, there] = [this.extents[from]?.positions, this.extents[to]?.positions];
    if (!here || !there) return [];
    const along = (at: number, axis: number) => there[3 * at + axis] - here[3 * at + axis];
    return Array.from({ length: here.length / 3 }, (_, at) => Math.hypot(along(at, 0), along(at, 1), along(at, 2)));
  }

  /** Positions of the samples in a frame, or the vertices of its cage. */
  private decoded(rows: Float32Array): Float32Array {
    const { weights } = this;
    if (!weights) return rows.slice(0, 3 * this.cageVertices);
    const values = this.decoder.valuesOf(rows);
    const positions = new Float32Array(3 * this.samples.length);
    for (let sample = 0, at = 0; sample < this.samples.length; sample++) {
      let [x, y, z] = [0, 0, 0];
      for (let k = 0; k < values.length; k += 3, at++) {
        const weight = weights[at];
        x += weight * values[k];
        y += weight * values[k + 1];
        z += weight * values[k + 2];
      }
      positions.set([x, y, z], 3 * sample);
    }
    return positions;
  }
}

/** Indices of points, x y z each, that are far from each other: each one is farthest from all before it. */
export function farthestPoints(points: ArrayLike<number>, count: number): Uint32Array {
  const stride = 3 * Math.max(1, Math.ceil(points.length / 3 / CANDIDATES));
  const candidates = Uint32Array.from({ length: Math.ceil(points.length / stride) }, (_, k) => k * stride);
  const distances = new Float64Array(candidates.length).fill(Infinity);
  const chosen = new Uint32Array(Math.min(count, candidates.length));
  let next = 0;
  for (let k = 0; k < chosen.length; k++) {
    const at = candidates[next];
    chosen[k] = at / 3;
    let farthest = 0;
    for (const [each, other] of candidates.entries()) {
      const [dx, dy, dz] = [
        points[other] - points[at],
        points[other + 1] - points[at + 1],
        points[other + 2] - points[at + 2],
      ];
      distances[each] = Math.min(distances[each], dx * dx + dy * dy + dz * dz);
      if (distances[each] > distances[farthest]) farthest = each;
    }
    next = farthest;
  }
  return chosen;
}

function extentOf(positions: Float32Array): Extent {
  const { low, high } = boundsOf(positions);
  return { box: [...low, ...high], mean: meanOf(positions, positions.length / 3), positions };
}

/** Into how many parts a capture is divided at the finest; the frames at their ends are read. */
const PARTS = 32;
/**
 * How many of the spread frames are read before the first decoded frame: the ends and the middle of a capture tell most of where it goes, and reading the rest
 * would mean reading nearly all of the capture.
 */
const EARLY_FRAMES = 3;
/** How long to wait for what is played. */
const WAIT_MILLISECONDS = 200;

/** Frames evenly spread, from coarse to fine: both ends, the middle, the quarters, and so on. */
function spreadFrames(last: number): Set<number> {
  const spread = new Set([0, last]);
  for (let parts = 2; parts <= PARTS; parts *= 2)
    for (let k = 1; k < parts; k += 2) spread.add(Math.round((k * last) / parts));
  return spread;
}

/**
 * Has frames of a finished capture read for what they say of its motion, one block after another, as long as the connection has time for them. Those that do
 * not come are left to whoever plays them.
 *
 * @param read keeps what it reads for whoever plays, so that what fits is fetched once, and includes it in the motion
 * @param player `buffering` while it waits for frames that are to be shown, `preparing` before it can show any
 */
export async function surveyMotion(
  capture: Capture,
  motion: Pick<Motion, 'knows'>,
  read: (frame: number) => Promise<unknown>,
  player: () => 'buffering' | 'preparing' | 'ready',
  signal: AbortSignal,
): Promise<void> {
  if (!capture.complete) return;
  const mustWait = (place: number) => player() === 'buffering' || (player() === 'preparing' && place >= EARLY_FRAMES);
  for (const [place, frame] of [...spreadFrames(capture.frames - 1)].entries()) {
    while (mustWait(place) && !signal.aborted) await new Promise((resolve) => setTimeout(resolve, WAIT_MILLISECONDS));
    if (signal.aborted) return;
    if (motion.knows(frame)) continue;
    await read(frame).catch(() => undefined);
  }
}
