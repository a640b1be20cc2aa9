import type { Covered } from '../render/drawn';
import type { Stage } from '../render/stage';

/** How fine the pictures of a stage are: coarser ones come faster while something moves. */
export class Resolution {
  /** Whether pictures stay as fine as they can be though something moves. */
  keepsFinest = false;
  covered: Covered = { top: 0, right: 0, bottom: 0 };
  private size = { width: 1, height: 1, pixelRatio: 1 };
  private shown = 1;

  constructor(private readonly stage: Stage) {}

  /** Share of the finest picture, in each direction, that is drawn. */
  get share(): number {
    return this.shown;
  }

  set share(share: number) {
    const wanted = this.keepsFinest ? 1 : share;
    if (wanted === this.shown) return;
    this.shown = wanted;
    const { width, height, pixelRatio } = this.size;
    this.stage.resize(width, height, pixelRatio * wanted, this.covered);
  }

  /** Takes the size of the canvas in CSS pixels, and how much of it is covered. */
  resize(width: number, height: number, pixelRatio: number, covered: Covered, share: number) {
    this.covered = covered;
    this.size = { width, height, pixelRatio: this.stage.isJagged ? 2 * pixelRatio : pixelRatio };
    this.shown = 0;
    this.share = share;
  }
}
