import type { Capture } from '../capture';
import type { FrameStore } from '../render/frameStore';
import type { Stage } from '../render/stage';

/** What colours the model: nothing, the movement from frame to frame, or the distance from where it was captured. */
export type Heat = 'none' | 'motion' | 'error';

/** Colours the model by a value of each point that belongs to the frame that is shown. */
export class HeatMap {
  /** Called when the colours have changed. */
  onChange: () => void = () => undefined;
  /** Called with one sentence where there are no values. */
  onProblem: (problem: string) => void = () => undefined;
  kind: Heat = 'none';
  /** What the warmest colour stands for, in diagonals: the largest value so far, so that colours of frames can be compared. */
  largest = 0;
  private frame = -1;

  constructor(
    private readonly capture: Capture,
    private readonly stage: Stage,
    private readonly store: FrameStore,
    private readonly signal: AbortSignal,
  ) {}

  /** The maps that this capture can have. */
  get kinds(): readonly Heat[] {
    return this.capture.pointErrors ? ['none', 'motion', 'error'] : ['none', 'motion'];
  }

  show(kind: Heat) {
    this.kind = kind;
    this.frame = -1;
    this.largest = 0;
    if (kind === 'none') this.stage.setHeat(null, 1);
  }

  /** Colours the model for a frame of so many. */
  update(frame: number, frames: number) {
    if (this.kind === 'none' || frame === this.frame || !this.stage.decoder.ready) return;
    if (this.kind === 'error') {
      this.frame = frame;
      void this.fetchErrors(frame);
    } else if (this.showMotion(frame, frame + 1 < frames ? frame + 1 : frame - 1)) {
      this.frame = frame;
      this.onChange();
    }
  }

  private showMotion(frame: number, neighbour: number): boolean {
    const [here, there] = [this.store.peek(frame), neighbour < 0 ? null : this.store.peek(neighbour)];
    if (!here || !there) return false;
    this.largest = Math.max(this.largest, this.farthestMove(here.rows, there.rows));
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

  private async fetchErrors(frame: number) {
    try {
      const errors = (await this.capture.pointErrors?.(frame, this.signal)) ?? null;
      if (this.kind !== 'error' || frame !== this.frame) return;
      if (errors === null) {
        throw new Error('The original of this frame is not kept, so that its errors cannot be shown on the model.');
      }
      for (const error of errors) if (error > this.largest) this.largest = error;
      this.stage.setHeat(errors, this.largest);
    } catch (error) {
      if (this.signal.aborted) return;
      this.show('none');
      this.onProblem(error instanceof Error ? error.message : String(error));
    }
    this.onChange();
  }
}
