import type { Original } from '../originals/original';
import type { Observed, ObservedSurfaces } from '../observed/surfaces';
import { errorsOf, pointErrors, type PointErrors } from '../originals/pointErrors';
import type { FrameStore } from '../render/frameStore';
import type { Motion } from '../render/motion';
import type { Stage } from '../render/stage';

/** What colours the model: nothing, the movement from frame to frame, or the distance from where it was captured. */
export type Heat = 'none' | 'motion' | 'error';

/** The errors of a frame that is shown. */
export interface MeasuredFrame extends PointErrors {
  readonly frame: number;
  /** Points as they are shown, x y z each, in the scene's unit. */
  readonly places: Float32Array;
}

/** Which points say what the warmest colour stands for: those of the frame that is shown, or of all frames. */
export type HeatRange = 'frame' | 'clip';

/** Frames whose errors stand for those of all. */
const MEASURED_FRAMES = 12;

/** Colours the model by a value of each point that belongs to the frame that is shown. */
export class HeatMap {
  onChange: () => void = () => undefined;
  /** Called when colours mean something else: those of the picture are to be computed anew. */
  onRange: () => void = () => undefined;
  kind: Heat = 'none';
  range: HeatRange = 'clip';
  /** Errors of the frame that is shown, where the map shows errors and the original is there. */
  measured: MeasuredFrame | null = null;
  /** The map of a capture that is shown beside this one: colours of both mean the same. */
  peer: HeatMap | null = null;
  private frame = -1;
  /** What 99 of 100 points stay below in the frame that is shown, and in the clip where that is known; in diagonals. */
  private usual: { readonly frame: number; readonly clip: number | null } = { frame: 0, clip: null };
  /** The original whose errors in the clip are known, or are being measured. */
  private surveyed: Original | null = null;

  constructor(
    private readonly stage: Stage,
    private readonly store: FrameStore,
    private readonly motion: Motion,
  ) {}

  readonly kinds: readonly Heat[] = ['none', 'motion', 'error'];

  /** What the warmest colour stands for, in diagonals: the worst point alone would leave all others dark. */
  get largest(): number {
    return Math.max(this.own, this.peer?.kind === this.kind ? this.peer.own : 0);
  }

  show(kind: Heat, range: HeatRange) {
    this.kind = kind;
    this.range = range;
    this.frame = -1;
    this.surveyed = null;
    this.measured = null;
    this.usual = { frame: 0, clip: null };
    this.stage.setHeat(null, 1);
  }

  /** Forgets what is coloured, which is computed anew with the next picture. */
  refresh() {
    this.frame = -1;
  }

  /** To be called when more frames have become known. */
  grow() {
    if (this.kind !== 'motion' || this.range !== 'clip' || this.motion.usualMoves === this.usual.clip) return;
    this.refresh();
    this.onRange();
  }

  /** Colours the model for a frame of so many, by its movement. */
  update(frame: number, frames: number) {
    if (this.kind !== 'motion' || frame === this.frame || !this.stage.decoder.ready) return;
    if (!this.showMotion(frame, frame + 1 < frames ? frame + 1 : frame - 1)) return;
    this.frame = frame;
    this.onChange();
  }

  /** Colours the model by how far the frame that is decoded, of so many, is from its original. */
  measure(frame: number, frames: number, original: Original | null) {
    const positions = original?.peek(frame);
    if (this.kind !== 'error' || !original || !positions || !this.stage.decoder.ready) return;
    const { decoder } = this.stage;
    const places = decoder.readPositions();
    this.paint(pointErrors(places, positions, decoder.diagonal), frame, places);
    if (this.range === 'clip' && this.surveyed !== original) void this.survey(original, frames);
  }

  /** The surface that a frame was recovered from; colours the model, which shows that frame, by how far it is from it. */
  async observe(frame: number, surfaces: ObservedSurfaces): Promise<Observed> {
    const { decoder } = this.stage;
    const places = decoder.readPositions();
    const observed = await surfaces.measure(frame, places);
    const errors = errorsOf(observed.distances.map((distance) => distance / decoder.diagonal));
    if (this.kind === 'error') this.paint(errors, frame, places);
    return observed;
  }

  private get own(): number {
    return this.range === 'clip' ? (this.usual.clip ?? this.usual.frame) : this.usual.frame;
  }

  /** @param places points as they are decoded, in the capture's unit */
  private paint(errors: PointErrors, frame: number, places: Float32Array) {
    this.stage.decoder.place(places);
    this.measured = { ...errors, frame, places };
    this.settle(errors.usual, this.usual.clip);
    this.stage.setHeat(errors.values, this.largest);
    this.onChange();
  }

  /** Finds what is usual, here; what is beside has the same colours. */
  private settle(frame: number, clip: number | null) {
    const { own, peer } = this;
    this.usual = { frame, clip };
    if (this.own === own || peer?.kind !== this.kind) return;
    peer.refresh();
    peer.onRange();
  }

  /** Measures the errors of frames spread over the clip, one after another; where one cannot be read, the range stays that of frames. */
  private async survey(original: Original, frames: number) {
    this.surveyed = original;
    const values: number[] = [];
    const count = Math.min(frames, MEASURED_FRAMES);
    const { decoder } = this.stage;
    try {
      for (let k = 0; k < count; k++) {
        const frame = Math.round((k * (frames - 1)) / Math.max(1, count - 1));
        const [{ rows, offsets }, positions] = await Promise.all([this.store.frame(frame), original.load(frame)]);
        if (this.surveyed !== original) return;
        decoder.decode({ rows, before: offsets, after: null, mix: 0 });
        values.push(...sampled(pointErrors(decoder.readPositions(), positions, decoder.diagonal).values));
        // What is shown is to be decoded again.
        this.onRange();
      }
    } catch {
      return;
    }
    this.settle(this.usual.frame, errorsOf(Float32Array.from(values)).usual);
    this.onRange();
  }

  private showMotion(frame: number, neighbour: number): boolean {
    const [here, there] = [this.store.peek(frame), neighbour < 0 ? null : this.store.peek(neighbour)];
    if (!here || !there) return false;
    this.settle(this.motion.usualMove(frame, neighbour), this.motion.usualMoves);
    this.stage.setMotion({ before: here.offsets, after: there.offsets }, here.rows, there.rows, this.largest);
    return true;
  }
}

function sampled(values: Float32Array): Float32Array {
  const stride = Math.max(1, Math.ceil(values.length / 4096));
  return values.filter((_, k) => k % stride === 0);
}
