import type { Capture } from '../capture';
import type { ObservedSurfaces } from '../observed/surfaces';
import type { Original } from '../originals/original';
import type { Side } from '../render/drawn';
import type { Stage } from '../render/stage';
import type { Dropped } from '../files/classify';

/** A place of the line that leaves some of both sides. */
const within = (share: number) => Math.min(0.95, Math.max(0.05, share || 0.5));

/** The capture beside the frames that it was encoded from, or the surfaces that it was recovered from, where somebody has given them to the page. */
export class Comparison {
  onChange: () => void = () => undefined;
  original: Original | null = null;
  surfaces: ObservedSurfaces | null = null;
  files: readonly Dropped[] = [];
  private shownSide: Side = 'decoded';
  private place = 0.5;
  /** Whether somebody has put the line where it is. */
  private wasMoved = false;

  constructor(
    private readonly capture: Capture,
    private readonly stage: Stage,
  ) {}

  get side(): Side {
    return this.shownSide;
  }

  set side(side: Side) {
    // The line begins where the model is.
    if (side === 'both' && this.shownSide !== 'both' && !this.wasMoved) this.place = within(this.stage.middleShare);
    this.shownSide = side;
    this.apply();
  }

  /** What can be shown: surfaces that something was recovered from have no ghost, as they are dots already. */
  get sides(): readonly Side[] {
    return this.surfaces ? ['decoded', 'both', 'original'] : ['decoded', 'both', 'ghost', 'original'];
  }

  /** Where the original ends and the decoded model begins, as a fraction of the width that nothing covers. */
  get split(): number {
    return this.place;
  }

  set split(split: number) {
    this.wasMoved = true;
    this.place = within(split);
    this.apply();
  }

  /** Takes the original frames. Throws one sentence for a person where they are not those of this capture. */
  async open(files: readonly Dropped[]): Promise<void> {
    const { openSurfaces } = await import('../observed/surfaces');
    const surfaces = await openSurfaces(files, this.capture);
    if (surfaces) {
      this.close();
      this.surfaces = surfaces;
      this.side = 'both';
    } else {
      const { openOriginal } = await import('../originals/original');
      const original = await openOriginal(files, this.capture);
      await original.load(0);
      this.close();
      this.original = original;
    }
    this.files = files;
    this.onChange();
  }

  close() {
    this.surfaces?.close();
    this.original = this.surfaces = null;
    this.files = [];
    this.stage.setObserved(null);
    this.side = 'decoded';
  }

  get isOpen(): boolean {
    return this.original !== null || this.surfaces !== null;
  }

  /** Gives the picture the original of a frame, which is in memory. */
  update(frame: number) {
    const positions = this.shownSide === 'decoded' ? null : this.original?.peek(frame);
    if (positions) this.stage.setOriginal(positions);
  }

  private apply() {
    this.stage.setSide(this.isOpen ? this.shownSide : 'decoded', this.place);
    this.onChange();
  }
}
