import type { Covered } from '../render/drawn';
import type { Stage } from '../render/stage';

/** Shares of the finest picture, in each direction, that are drawn while something moves. */
const STEPS = [1, 0.75, 0.5, 0.36] as const;
/** Pictures per second below which a coarser picture is drawn, and above which a finer one is tried. */
const [SLOW, FAST] = [24, 52];
/** Seconds between changes. */
const PATIENCE = 0.7;

/** What covers the pictures of a file. */
const NOTHING: Covered = { top: 0, right: 0, bottom: 0, left: 0 };

/** Chooses how fine pictures are: coarser while something moves on a slow device, the finest when all rests. */
export class Quality {
  private step: number;
  private waited = 0;
  /** Of the last pictures; 0 before there were any. */
  private rate = 0;

  /** @param isSlow whether pictures are known to take long, so that the first ones are coarse */
  constructor(isSlow = false) {
    this.step = isSlow ? 2 : 0;
  }

  get moving(): number {
    return STEPS[this.step];
  }

  get picturesPerSecond(): number {
    return this.rate;
  }

  /** Takes the seconds that a picture took while something moved. */
  measure(seconds: number) {
    if (seconds <= 0) return;
    const weight = Math.min(1, seconds / 0.4);
    this.rate += (1 / seconds - this.rate) * (this.rate === 0 ? 1 : weight);
    this.waited += seconds;
    if (this.waited < PATIENCE) return;
    if (this.rate < SLOW && this.step < STEPS.length - 1) this.change(1);
    else if (this.rate > FAST && this.step > 0) this.change(-1);
  }

  private change(by: number) {
    this.step += by;
    this.waited = 0;
  }
}

/** How fine the pictures of a stage are: coarser ones come faster while something moves. */
export class Resolution {
  covered = NOTHING;
  private size = { width: 1, height: 1, pixelRatio: 1 };
  private shown = 1;
  private forFile = false;

  constructor(private readonly stage: Stage) {}

  /** Share of the finest picture, in each direction, that is drawn. */
  get share(): number {
    return this.shown;
  }

  set share(share: number) {
    const wanted = this.forFile ? 1 : share;
    if (wanted === this.shown) return;
    this.shown = wanted;
    this.apply();
  }

  /** Whether pictures are for a file: as fine as they can be though something moves, with nothing above them that the model would have to stand beside. */
  get isForFile(): boolean {
    return this.forFile;
  }

  set isForFile(isForFile: boolean) {
    this.forFile = isForFile;
    if (isForFile) this.shown = 1;
    this.apply();
  }

  /** Takes the size of the canvas in CSS pixels, and how much of it is covered. */
  resize(width: number, height: number, pixelRatio: number, covered: Covered, share: number) {
    this.covered = covered;
    this.size = { width, height, pixelRatio: this.stage.isJagged ? Math.min(2, 2 * pixelRatio) : pixelRatio };
    this.shown = 0;
    this.share = share;
  }

  private apply() {
    const { width, height, pixelRatio } = this.size;
    this.stage.resize(width, height, pixelRatio * this.shown, this.forFile ? NOTHING : this.covered);
  }
}
