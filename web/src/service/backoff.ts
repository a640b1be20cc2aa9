/** Waiting before trying again: longer each time, with chance, and shorter when the network comes back. */

import { ServiceProblem, problemBehind } from './problem';

const FIRST_SECONDS = 0.4;
const MAX_SECONDS = 15;

/** Grows the wait between attempts, from 0.4 s to 15 s, each at random between half and all of it. */
export class Backoff {
  private attempts = 0;

  /** Seconds to wait before the next attempt; what the service asked for, if that is longer. */
  next(asked: number | null = null): number {
    const most = Math.min(MAX_SECONDS, FIRST_SECONDS * 2 ** this.attempts);
    this.attempts += 1;
    return Math.max(asked ?? 0, most * (0.5 + 0.5 * Math.random()));
  }

  reset() {
    this.attempts = 0;
  }
}

/** Ends every {@link pause}, as the return of the network does. */
export function retryNow() {
  globalThis.dispatchEvent(new Event('online'));
}

/** Waits; the return of the network ends it early, and `signal` ends it with its reason. */
export async function pause(seconds: number, signal?: AbortSignal) {
  const over = new EventTarget();
  const timer = setTimeout(() => over.dispatchEvent(new Event('over')), 1000 * seconds);
  try {
    await nextEvent(signal, [over, 'over'], [globalThis, 'online']);
  } finally {
    clearTimeout(timer);
  }
}

/** The first event of any target, or an abort of `signal`, with its reason. */
export function nextEvent(signal: AbortSignal | undefined, ...targets: readonly Heard[]): Promise<void> {
  return new Promise((resolve, reject) => {
    signal?.throwIfAborted();
    const end = new AbortController();
    const ended = (act: () => void) => () => {
      end.abort();
      act();
    };
    for (const [target, type] of targets) target.addEventListener(type, ended(resolve), { signal: end.signal });
    signal?.addEventListener(
      'abort',
      ended(() => reject(signal.reason as Error)),
      { signal: end.signal },
    );
  });
}

type Heard = readonly [target: Pick<EventTarget, 'addEventListener'>, type: string];

/** What {@link persistently} says before it waits. */
export interface Retry {
  readonly problem: ServiceProblem;
  readonly seconds: number;
}

/**
 * Repeats what may be repeated until it succeeds, or fails with something that does not pass by itself. `attempts` bounds how often in a row;
 * `onRetry` hears of every wait.
 */
export async function persistently<T>(
  work: () => Promise<T>,
  options: { signal?: AbortSignal | undefined; attempts?: number; onRetry?: (retry: Retry) => void } = {},
): Promise<T> {
  const backoff = new Backoff();
  for (let left = options.attempts ?? Infinity; ; left -= 1) {
    try {
      return await work();
    } catch (error) {
      const problem = problemBehind(error);
      if (!(problem instanceof ServiceProblem) || !problem.passes || left <= 1) throw problem;
      const seconds = backoff.next(problem.retryAfter);
      options.onRetry?.({ problem, seconds });
      await pause(seconds, options.signal);
    }
  }
}
