/** The sessions that are shown, kept up to date by polling. */

import { Backoff } from '../service/backoff';
import { RateMeter } from '../service/measures';
import type { Session } from '../service/messages';
import { ServiceProblem, isAbort, problemBehind } from '../service/problem';
import type { Service } from '../service/service';

const POLL_RUNNING_SECONDS = 2;
const POLL_IDLE_SECONDS = 5;
const RATE_SECONDS = 15;

/** The sessions of a token, newest first. Fires `change`. */
export class SessionList extends EventTarget {
  /** Why the list is not up to date, and when it is asked for again, as of `Date.now()`. */
  trouble: { problem: Error; retryAt: number | null } | null = null;
  /** Sessions that are seen: unfinished ones among them are kept up to date although they are older than the newest page. */
  shown: ReadonlySet<string> = new Set();
  /** Whether the service was asked at least once and answered. */
  loaded = false;

  private readonly known = new Map<string, Session>();
  private readonly rates = new Map<string, RateMeter>();
  private readonly backoff = new Backoff();
  /** Where older sessions begin; undefined before the first page, null after the last. */
  private next: string | null | undefined;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private running: AbortController | null = null;

  constructor(private readonly service: Service) {
    super();
  }

  /** Newest first. */
  get sessions(): Session[] {
    return [...this.known.values()].sort((a, b) => b.created - a.created || (a.id < b.id ? 1 : -1));
  }

  /** Frames per second of a session that runs. */
  rateOf(id: string): number {
    return this.rates.get(id)?.perSecond() ?? 0;
  }

  get hasOlder(): boolean {
    return typeof this.next === 'string';
  }

  start() {
    if (this.running) return;
    this.running = new AbortController();
    void this.poll(this.running.signal);
  }

  /** Stops all requests, as while the page is hidden. */
  stop() {
    this.running?.abort();
    this.running = null;
    clearTimeout(this.timer);
  }

  refresh() {
    const wasRunning = this.running !== null;
    this.stop();
    if (wasRunning) this.start();
  }

  /** Forgets everything, for another token. */
  reset() {
    this.known.clear();
    this.rates.clear();
    this.next = undefined;
    this.loaded = false;
    this.trouble = null;
    this.changed();
    this.refresh();
  }

  async older() {
    if (typeof this.next !== 'string') return;
    const asked = this.next;
    const page = await this.service.sessions(asked, this.running?.signal);
    // Two callers may have asked for the same page.
    if (this.next === asked) this.next = page.next;
    page.sessions.forEach((session) => this.take(session));
    this.changed();
  }

  async rename(id: string, name: string) {
    this.take(await this.service.rename(id, name));
    this.changed();
    // What was asked for before may come after this.
    this.refresh();
  }

  async remove(id: string) {
    await this.service.remove(id);
    this.forget(id);
    this.changed();
  }

  private async poll(signal: AbortSignal) {
    let seconds: number;
    try {
      await this.fetchNewest(signal);
      this.backoff.reset();
      this.trouble = null;
      this.loaded = true;
      const isRunning = [...this.known.values()].some(isUnfinished);
      seconds = isRunning ? POLL_RUNNING_SECONDS : POLL_IDLE_SECONDS;
    } catch (error) {
      if (isAbort(error) || signal.aborted) return;
      const problem = problemBehind(error);
      const passes = problem instanceof ServiceProblem && problem.passes;
      seconds = this.backoff.next(problem instanceof ServiceProblem ? problem.retryAfter : null);
      this.trouble = { problem, retryAt: passes ? Date.now() + 1000 * seconds : null };
      if (!passes) {
        this.changed();
        return;
      }
    }
    if (signal.aborted) return;
    this.changed();
    this.timer = setTimeout(() => void this.poll(signal), 1000 * seconds);
  }

  private async fetchNewest(signal: AbortSignal) {
    const page = await this.service.sessions(null, signal);
    const listed = new Set(page.sessions.map((session) => session.id));
    const oldest = page.next === null ? -Infinity : (page.sessions.at(-1)?.created ?? -Infinity);
    for (const session of this.known.values()) {
      if (listed.has(session.id)) continue;
      if (session.created > oldest) this.forget(session.id);
      else if (isUnfinished(session) && this.shown.has(session.id)) await this.fetchOne(session.id, signal);
    }
    page.sessions.forEach((session) => this.take(session));
    if (this.next === undefined) this.next = page.next;
  }

  private async fetchOne(id: string, signal: AbortSignal) {
    try {
      this.take(await this.service.session(id, signal));
    } catch (error) {
      if (!(error instanceof ServiceProblem && error.isGone)) throw error;
      this.forget(id);
    }
  }

  private take(session: Session) {
    const before = this.known.get(session.id)?.frames.solved ?? session.frames.solved;
    this.known.set(session.id, session);
    if (session.state !== 'ready') return;
    const rate = this.rates.get(session.id) ?? new RateMeter(RATE_SECONDS);
    this.rates.set(session.id, rate);
    rate.add(session.frames.solved - before);
  }

  private forget(id: string) {
    this.known.delete(id);
    this.rates.delete(id);
  }

  private changed() {
    this.dispatchEvent(new Event('change'));
  }
}

/** Whether anything of a session can still change by itself. */
export function isUnfinished(session: Session): boolean {
  return session.state === 'preparing' || session.state === 'ready';
}
