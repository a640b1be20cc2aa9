import type { Capture } from '../capture';
import type { Original } from '../originals/original';
import type { Observed, ObservedSurfaces } from '../observed/surfaces';
import { errorsOf, pointErrors, type PointErrors } from '../originals/pointErrors';
import type { FrameStore } from '../render/frameStore';
import type { Stage } from '../render/stage';

/** What colours the model: nothing, the movement from frame to frame, or the distance from where it was captured. */
export type Heat = 'none' | 'motion' | 'error';

/** The errors of a frame that is shown. */
export interface MeasuredFrame extends PointErrors {
  readonly frame: number;
  /** Points as they are shown, x y z each, in the scene's unit. */
  readonly places: Float32Array;
}

/** Colours the model by a value of each point that belongs to the frame that is shown. */
export class HeatMap {
  /** Called when the colours have changed. */
  onChange: () => void = () => undefined;
  /** Called when colours mean something else: those of the picture are to be computed anew. */
  onRange: () => void = () => undefined;
  kind: Heat = 'none';
  /**
   * What the warmest colour stands for, in diagonals: the largest value so far, so that colours of frames can be compared. Of errors it is what all
   * but a few points stay below: the worst one alone would leave all others dark.
   */
  largest = 0;
  /** Errors of the frame that is shown, where the map shows errors and the original is there. */
  measured: MeasuredFrame | null = null;
  /** The map of a capture that is shown beside this one: colours of both mean the same. */
  peer: HeatMap | null = null;
  private frame = -1;

  constructor(
    private readonly capture: Capture,
    private readonly stage: Stage,
    private readonly store: FrameStore,
  ) {}

  /** The maps that there are. */
  readonly kinds: readonly Heat[] = ['none', 'motion', 'error'];

  show(kind: Heat) {
    this.kind = kind;
    this.frame = -1;
    this.largest = 0;
    this.measured = null;
    this.stage.setHeat(null, 1);
  }

  /** Forgets what is coloured, which is computed anew with the next picture. */
  refresh() {
    this.frame = -1;
  }

  /** Colours the model for a frame of so many, by its movement. */
  update(frame: number, frames: number) {
    if (this.kind !== 'motion' || frame === this.frame || !this.stage.decoder.ready) return;
    if (!this.showMotion(frame, frame + 1 < frames ? frame + 1 : frame - 1)) return;
    this.frame = frame;
    this.onChange();
  }

  /** Colours the model by how far the frame that is decoded is from its original. */
  measure(frame: number, original: Original | null) {
    const positions = original?.peek(frame);
    if (this.kind !== 'error' || !positions || !this.stage.decoder.ready) return;
    const { decoder } = this.stage;
    const places = decoder.readPositions();
    this.paint(pointErrors(places, positions, decoder.diagonal), frame, places);
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

  /** @param places points as they are decoded, in the capture's unit */
  private paint(errors: PointErrors, frame: number, places: Float32Array) {
    this.stage.decoder.place(places);
    this.measured = { ...errors, frame, places };
    this.raise(errors.usual);
    this.stage.setHeat(errors.values, this.largest);
    this.onChange();
  }

  /** Widens the range of the colours, here and beside. */
  private raise(value: number) {
    const { peer } = this;
    this.largest = Math.max(this.largest, value, peer?.kind === this.kind ? peer.largest : 0);
    if (peer?.kind !== this.kind || peer.largest === this.largest) return;
    peer.largest = this.largest;
    peer.refresh();
    peer.onRange();
  }

  private showMotion(frame: number, neighbour: number): boolean {
    const [here, there] = [this.store.peek(frame), neighbour < 0 ? null : this.store.peek(neighbour)];
    if (!here || !there) return false;
    this.raise(this.farthestMove(here.rows, there.rows));
    this.stage.setMotion({ before: here.offsets, after: there.offsets }, here.rows, there.rows, this.largest);
    return true;
  }

  /** How far a vertex of the cage moves at the most, in diagonals. */
  private farthestMove(from: Float32Array, to: Float32Array): number {
    let farthest = 0;
    for (let k = 0; k < this.capture.static.cage.positions.length; k += 3) {
      farthest = Math.max(farthest, Math.hypot(to[k] - from[k], to[k + 1] - from[k + 1], to[k + 2] - from[k + 2]));
    }
    return farthest / this.stage.decoder.diagonal;
  }
}
