/** How a running session reaches this page: rates, delay, and what came late. */

export class RateMeter {
  private samples: { at: number; amount: number }[] = [];
  private began = performance.now();

  /** @param window seconds that count */
  constructor(private readonly window = 4) {}

  add(amount: number) {
    const now = performance.now();
    if (this.samples.length === 0) this.began = now;
    const last = this.samples.at(-1);
    // Pieces of a fast transfer are too many to be kept one by one.
    if (last && now - last.at < 50) last.amount += amount;
    else this.samples.push({ at: now, amount });
  }

  perSecond(): number {
    const now = performance.now();
    this.samples = this.samples.filter((sample) => now - sample.at < 1000 * this.window);
    const sum = this.samples.reduce((total, sample) => total + sample.amount, 0);
    const seconds = Math.min(this.window, Math.max(0.25, (now - this.began) / 1000));
    return sum / seconds;
  }
}

/**
 * Estimates the delay between a frame's being solved and its arrival. A look at the session says how many frames are solved at a time between the
 * request and its answer; the delay is how much later the last of them arrived.
 */
export class LatencyMeter {
  /** Null before it was measured. */
  seconds: number | null = null;
  private awaited: { frame: number; at: number } | null = null;
  /** Frames below this one are here, or are not sent. */
  private next = 0;

  /** Begins anew, with a stream whose first frame is `next`. */
  reset(next: number) {
    this.seconds = null;
    this.awaited = null;
    this.next = next;
  }

  /** A frame arrived; they come in order. */
  arrived(frame: number) {
    const now = performance.now();
    this.next = frame + 1;
    if (this.awaited && frame >= this.awaited.frame) {
      this.take((now - this.awaited.at) / 1000);
      this.awaited = null;
    }
  }

  /** A look at the session: asked at `from`, answered at `to` (of `performance.now()`), frames up to `frame` solved. */
  looked(from: number, to: number, frame: number) {
    const solvedBy = (from + to) / 2;
    if (frame < this.next) this.take((to - from) / 2000);
    else this.awaited ??= { frame, at: solvedBy };
  }

  private take(seconds: number) {
    this.seconds = this.seconds === null ? seconds : 0.7 * this.seconds + 0.3 * seconds;
  }
}
