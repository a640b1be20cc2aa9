/** The blocks decoded last, and those that are being decoded. */

import type { FrameBlock } from '../capture';

/** Blocks that are kept: what is played, and what comes next. Whoever shows frames keeps more of them. */
const KEPT_BLOCKS = 2;

interface Pending {
  readonly promise: Promise<FrameBlock>;
  readonly abort: AbortController;
  /** Callers that wait for it. */
  waiting: number;
  /** Whether it is loaded ahead, for nobody yet. */
  ahead: boolean;
}

/** Decodes each block once for all who ask for it; one that nobody waits for any more is given up. */
export class BlockCache {
  private readonly done = new Map<number, FrameBlock>();
  private readonly pending = new Map<number, Pending>();

  constructor(private readonly load: (first: number, signal: AbortSignal) => Promise<FrameBlock>) {}

  async get(first: number, signal?: AbortSignal): Promise<FrameBlock> {
    signal?.throwIfAborted();
    const done = this.done.get(first);
    if (done !== undefined) {
      this.keep(done);
      return done;
    }
    const pending = this.start(first);
    pending.waiting++;
    try {
      return await orAborted(pending.promise, signal);
    } finally {
      pending.waiting--;
      if (pending.waiting === 0 && !pending.ahead) this.giveUp(first, pending);
    }
  }

  has(first: number): boolean {
    return this.done.has(first);
  }

  /** Begins to load a block that will be wanted, instead of others that were. */
  prefetch(first: number): void {
    for (const [other, pending] of this.pending) {
      pending.ahead = false;
      if (other !== first && pending.waiting === 0) this.giveUp(other, pending);
    }
    if (!this.done.has(first)) this.start(first).ahead = true;
  }

  clear(): void {
    for (const [first, pending] of this.pending) this.giveUp(first, pending);
    this.done.clear();
  }

  private start(first: number): Pending {
    const running = this.pending.get(first);
    if (running !== undefined) return running;
    const abort = new AbortController();
    const promise = this.load(first, abort.signal).then(
      (block) => {
        if (this.remove(first, pending)) this.keep(block);
        return block;
      },
      (error: unknown) => {
        this.remove(first, pending);
        throw error;
      },
    );
    // Whoever waits hears of a failure; of a prefetched block nobody has to.
    promise.catch(() => undefined);
    const pending: Pending = { promise, abort, waiting: 0, ahead: false };
    this.pending.set(first, pending);
    return pending;
  }

  private giveUp(first: number, pending: Pending): void {
    this.remove(first, pending);
    pending.abort.abort();
  }

  /** Whether it was still to be kept. */
  private remove(first: number, pending: Pending): boolean {
    return this.pending.get(first) === pending && this.pending.delete(first);
  }

  private keep(block: FrameBlock): void {
    this.done.delete(block.first);
    this.done.set(block.first, block);
    const [oldest] = this.done.keys();
    if (this.done.size > KEPT_BLOCKS) this.done.delete(oldest);
  }
}

/** The promise's result, or the signal's reason as soon as it is aborted. */
function orAborted<T>(promise: Promise<T>, signal: AbortSignal | undefined): Promise<T> {
  if (signal === undefined) return promise;
  return new Promise((resolve, reject) => {
    const abort = () => reject(signal.reason as Error);
    signal.addEventListener('abort', abort, { once: true });
    promise.then(resolve, reject).finally(() => signal.removeEventListener('abort', abort));
  });
}
