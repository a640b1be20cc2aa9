/** Shares of the finest picture, in each direction, that are drawn while something moves. */
const STEPS = [1, 0.75, 0.5, 0.36] as const;
/** Pictures per second below which a coarser picture is drawn, and above which a finer one is tried. */
const [SLOW, FAST] = [24, 52];
/** Seconds between changes. */
const PATIENCE = 0.7;

/** Chooses how fine pictures are: coarser while something moves on a slow device, the finest when all rests. */
export class Quality {
  private step: number;
  private waited = 0;
  private rate = 60;

  /** @param isSlow whether pictures are known to take long, so that the first ones are coarse */
  constructor(isSlow = false) {
    this.step = isSlow ? 2 : 0;
  }

  /** Share of the finest picture while something moves. */
  get moving(): number {
    return STEPS[this.step];
  }

  /** Pictures per second of late. */
  get picturesPerSecond(): number {
    return this.rate;
  }

  /** Takes the seconds that a picture took while something moved. */
  measure(seconds: number) {
    if (seconds <= 0) return;
    const weight = Math.min(1, seconds / 0.4);
    this.rate += (1 / seconds - this.rate) * weight;
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
