/** Sends a capture to the service: a session, its frames, its completion. Goes on over broken connections, and after being stopped. */

import { Backoff, type Retry, pause, persistently } from '../service/backoff';
import { type Session, type SessionOptions, unsolved } from '../service/messages';
import { ServiceProblem, isAbort, problemBehind, problemFrom, sentenceOf } from '../service/problem';
import { type Service, sessionPath } from '../service/service';
import { RateMeter } from '../service/measures';
import { type Figures, containerFigures } from '../sessions/figures';
import { FrameSender } from './frameSender';
import type { Plan } from './plan';

/** Where an upload is. */
export type Stage = 'creating' | 'preparing' | 'sending' | 'completing' | 'completed' | 'stopped' | 'failed';

/** Errors of the frames that are solved, as fractions of the diagonal; NaN where not known. */
export interface Measured {
  readonly l2: Float32Array;
  readonly linf: Float32Array;
}

const PREPARING_POLL_SECONDS = 0.5;

/** One upload. Fires `change`. */
export class UploadJob extends EventTarget {
  stage: Stage = 'creating';
  /** The session, once the service made it. */
  session: Session | null = null;
  /** Why it stands still or failed, a sentence; empty while all is well. */
  trouble = '';
  /** Of the container, once it is written. */
  figures: Figures | null = null;
  /** Frames that the service has acknowledged. */
  done = 0;
  /** Whether the handles' rows alone are sent, and errors so are not measured. */
  handlesOnly = false;
  readonly measured: Measured;
  readonly #frames = new RateMeter();
  readonly #bytes = new RateMeter();
  readonly #key = crypto.randomUUID();
  #stopping = new AbortController();

  constructor(
    private readonly service: Service,
    readonly plan: Plan,
    readonly options: SessionOptions,
    /** Send handle rows alone where these are less. */
    private readonly wantsHandlesOnly: boolean,
  ) {
    super();
    const unknown = (): Float32Array => new Float32Array(plan.frames.frames).fill(Number.NaN);
    this.measured = { l2: unknown(), linf: unknown() };
  }

  get isActive(): boolean {
    return this.stage !== 'completed' && this.stage !== 'stopped' && this.stage !== 'failed';
  }

  get framesPerSecond(): number {
    return this.#frames.perSecond();
  }

  get bytesPerSecond(): number {
    return this.#bytes.perSecond();
  }

  /** Seconds until the last frame is there, at the present rate; null while the rate is unknown. */
  get secondsLeft(): number | null {
    const rate = this.framesPerSecond;
    return rate > 0 ? (this.plan.frames.frames - this.done) / rate : null;
  }

  /** Stops; what the service has stays there, and {@link run} goes on with the rest. */
  stop(): void {
    this.#stopping.abort();
  }

  /** Stops, and deletes what the service has. */
  async discard(): Promise<void> {
    this.stop();
    if (this.session) await this.service.remove(this.session.id);
  }

  /** Begins, or goes on. Ends with the stage `completed`, `stopped` or `failed`; never throws. */
  async run(): Promise<void> {
    this.#stopping = new AbortController();
    const { signal } = this.#stopping;
    try {
      this.#enter('creating');
      this.session ??= await this.#retry(() => this.#create(signal), signal);
      this.#enter('preparing');
      await this.#prepared(this.session.id, signal);
      this.#enter('sending');
      await this.#send(this.session.id, signal);
      this.#enter('completing');
      const { id } = this.session;
      this.session = await this.#retry(() => this.service.complete(id, this.plan.frames.frames, signal), signal);
      this.figures = await containerFigures(this.service, this.session).catch(() => null);
      this.#enter('completed');
    } catch (error) {
      this.trouble = isAbort(error) ? '' : sentenceOf(error);
      this.#enter(isAbort(error) ? 'stopped' : 'failed');
    }
  }

  async #create(signal: AbortSignal): Promise<Session> {
    const body = new FormData();
    body.append('options', JSON.stringify(this.options));
    body.append('rest', this.plan.rest);
    if (this.plan.cage) body.append('cage', this.plan.cage);
    const headers = { 'Idempotency-Key': this.#key };
    return this.service.json<Session>('sessions', { method: 'POST', headers, body, signal });
  }

  async #prepared(id: string, signal: AbortSignal): Promise<void> {
    for (;;) {
      this.session = await this.#retry(() => this.service.session(id, signal), signal);
      if (this.session.problem) throw problemFrom(this.session.problem);
      if (this.session.state !== 'preparing') break;
      this.#changed();
      await pause(PREPARING_POLL_SECONDS, signal);
    }
    const { points } = this.session;
    if (points !== null && points !== this.plan.frames.points) {
      throw new Error(
        `The rest pose has ${points} points and the frames have ${this.plan.frames.points}: both have to be the same mesh. Nothing was sent but the rest pose.`,
      );
    }
  }

  async #send(id: string, signal: AbortSignal): Promise<void> {
    const { frames } = this.plan;
    const sender = await this.#sender(id, signal);
    const backoff = new Backoff();
    // Whatever broke off, what is missing then is what the service says.
    for (;;) {
      const session = await this.#retry(() => this.service.session(id, signal), signal);
      if (session.problem) throw problemFrom(session.problem);
      if (session.coding?.problem) throw problemFrom(session.coding.problem);
      this.session = session;
      const ranges = unsolved(session.frames, frames.frames);
      this.done = frames.frames - ranges.reduce((sum, [first, end]) => sum + end - first, 0);
      this.#changed();
      if (session.state === 'completed' || ranges.length === 0) return;
      try {
        await sender.send(ranges, signal);
        backoff.reset();
      } catch (error) {
        const problem = problemBehind(error);
        if (!(problem instanceof ServiceProblem) || !problem.passes) throw problem;
        await this.#wait({ problem, seconds: backoff.next(problem.retryAfter) }, signal);
      }
    }
  }

  async #sender(id: string, signal: AbortSignal): Promise<FrameSender> {
    const handles = await this.#retry(() => this.service.handles(id, signal), signal);
    const coded = this.session?.coding !== undefined;
    this.handlesOnly =
      this.wantsHandlesOnly && !coded && this.session?.handles !== 'all' && handles.length < this.plan.frames.points;
    return new FrameSender(
      this.service,
      sessionPath(id, 'frames'),
      this.plan.frames,
      this.handlesOnly ? handles : null,
      {
        solved: (result) => {
          this.measured.l2[result.frame] = result.l2 ?? Number.NaN;
          this.measured.linf[result.frame] = result.linf ?? Number.NaN;
        },
        sent: (count, bytes) => {
          this.done += count;
          this.#frames.add(count);
          this.#bytes.add(bytes);
          this.trouble = '';
          this.#changed();
        },
      },
    );
  }

  async #retry<T>(work: () => Promise<T>, signal: AbortSignal): Promise<T> {
    const result = await persistently(work, { signal, onRetry: (retry) => this.#say(retry) });
    this.trouble = '';
    return result;
  }

  #wait(retry: Retry, signal: AbortSignal): Promise<void> {
    this.#say(retry);
    return pause(retry.seconds, signal);
  }

  #say({ problem, seconds }: Retry): void {
    this.trouble = `${problem.message} The upload tries again in ${Math.ceil(seconds)} s.`;
    this.#changed();
  }

  #enter(stage: Stage): void {
    this.stage = stage;
    this.#changed();
  }

  #changed(): void {
    this.dispatchEvent(new Event('change'));
  }
}
