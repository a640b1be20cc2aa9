/** Sends a capture to the service: a cage's design, a session, its frames, its completion. Goes on over broken connections, and after being stopped. */

import { Backoff, type Retry, pause, persistently } from '../service/backoff';
import {
  type DesignOptions,
  type CageDesign,
  type Session,
  type SessionOptions,
  throwIfFailed,
  unsolved,
} from '../service/messages';
import { ServiceProblem, isAbort, problemBehind, problemFrom, sentenceOf } from '../service/problem';
import { type Service, sessionPath } from '../service/service';
import { RateMeter } from '../service/measures';
import { type Figures, containerFigures } from '../sessions/figures';
import { checkReadable } from '../files/frameSource';
import { FrameSender } from './frameSender';
import { type KeptUpload, newKey } from './keptUpload';
import { MotionCage } from './motionCage';
import type { Plan } from './plan';

export type Stage =
  'designing' | 'creating' | 'preparing' | 'sending' | 'completing' | 'completed' | 'stopped' | 'failed';

/** Errors of the frames that are solved, as fractions of the diagonal; NaN where not known. */
export interface Measured {
  readonly l2: Float32Array;
  readonly linf: Float32Array;
}

const PREPARING_POLL_SECONDS = 0.5;

export interface UploadRequest {
  readonly options: SessionOptions;
  /** What the cage is to be that is designed first; null where none is. */
  readonly design: DesignOptions | null;
}

/** One upload. Fires `change`. */
export class UploadJob extends EventTarget {
  stage: Stage;
  session: Session | null = null;
  /** Why it stands still or failed, a sentence; empty while all is well. */
  trouble = '';
  /** Of the container, once it is written. */
  figures: Figures | null = null;
  /** Frames that the service has acknowledged. */
  done = 0;
  readonly measured: Measured;
  private readonly frames = new RateMeter();
  private readonly bytes = new RateMeter();
  private readonly cage: MotionCage;
  private stopping = new AbortController();

  /** @param kept what goes on after the page was closed; with a session or a design, this upload goes on with it */
  constructor(
    private readonly service: Service,
    readonly plan: Plan,
    readonly request: UploadRequest,
    private readonly kept: KeptUpload,
  ) {
    super();
    this.stage = request.design ? 'designing' : 'creating';
    this.cage = new MotionCage(service, plan, kept, () => this.changed());
    const unknown = (): Float32Array => new Float32Array(plan.frames.frames).fill(Number.NaN);
    this.measured = { l2: unknown(), linf: unknown() };
  }

  /** Whether the errors of a coded capture are those of its file. */
  isMeasuredAsCoded = false;

  get isActive(): boolean {
    return this.stage !== 'completed' && this.stage !== 'stopped' && this.stage !== 'failed';
  }

  get framesPerSecond(): number {
    return this.frames.perSecond();
  }

  get bytesPerSecond(): number {
    return this.bytes.perSecond();
  }

  /** Seconds until the last frame is there, at the present rate; null while the rate is unknown. */
  get secondsLeft(): number | null {
    const rate = this.framesPerSecond;
    return rate > 0 ? (this.plan.frames.frames - this.done) / rate : null;
  }

  /** Stops; what the service has stays there, and {@link run} goes on with the rest. */
  stop() {
    this.stopping.abort();
  }

  takeBest() {
    this.cage.takeBest();
  }

  get design(): CageDesign | null {
    return this.cage.progress;
  }

  /** Stops, and deletes what the service has. */
  async discard() {
    this.stop();
    const { session } = this.kept.present;
    if (session !== null) await this.service.remove(session);
    await this.cage.putAway();
    this.kept.forget();
  }

  /** Begins, or goes on. Ends with the stage `completed`, `stopped` or `failed`; never throws. */
  async run() {
    this.stopping = new AbortController();
    const { signal } = this.stopping;
    this.kept.set({});
    this.kept.hold();
    try {
      if (this.request.design && this.kept.present.session === null && !this.cage.file) {
        this.enter('designing');
        const retry = <T>(work: () => Promise<T>): Promise<T> => this.retry(work, signal);
        await this.cage.design(this.request.design, retry, signal);
      }
      this.enter('creating');
      const { session } = this.kept.present;
      this.session = await this.retry(
        () => (session === null ? this.create(signal) : this.service.session(session, signal)),
        signal,
      );
      this.kept.set({ session: this.session.id });
      this.enter('preparing');
      await this.prepared(this.session.id, signal);
      await this.cage.putAway();
      this.enter('sending');
      await this.send(this.session.id, signal);
      this.enter('completing');
      const { id } = this.session;
      this.session = await this.retry(() => this.service.complete(id, this.plan.frames.frames, signal), signal);
      this.kept.forget();
      this.figures = await containerFigures(this.service, this.session).catch(() => null);
      // Those of coded frames were told before their fine detail was added.
      if (this.session.coding) {
        this.isMeasuredAsCoded = await this.recall(id, signal).then(
          () => true,
          () => false,
        );
        this.trouble = '';
      }
      this.enter('completed');
    } catch (error) {
      const isSignedOut = error instanceof ServiceProblem && error.status === 401;
      if (this.stage === 'designing' && !isSignedOut) await this.cage.putAway();
      this.trouble = isAbort(error) ? '' : this.sentence(error);
      this.enter(isAbort(error) ? 'stopped' : 'failed');
    } finally {
      this.kept.release();
    }
  }

  /** What went wrong; of a session that is gone, what is to be done with its frames. */
  private sentence(error: unknown): string {
    const problem = problemBehind(error);
    if (!(problem instanceof ServiceProblem && problem.isGone)) return sentenceOf(problem);
    const { session } = this.kept.present;
    if (session === null) return sentenceOf(problem);
    // What is sent from now on is another upload.
    this.kept.set({ session: null, design: null, key: newKey() });
    this.session = null;
    this.done = 0;
    this.measured.l2.fill(Number.NaN);
    this.measured.linf.fill(Number.NaN);
    return 'The session was deleted during the upload. Start again to upload everything to a new one.';
  }

  /** Whether nothing of it is at the service any more, or yet. */
  get isAnew(): boolean {
    return this.kept.present.session === null;
  }

  private async create(signal: AbortSignal): Promise<Session> {
    const body = new FormData();
    const { key, design } = this.kept.present;
    const cage = this.cage.file ?? this.plan.cage;
    await checkReadable([this.plan.rest, cage]);
    const designed = cage === null && design !== null ? { cage: { id: design } } : {};
    body.append('options', JSON.stringify({ ...this.request.options, ...designed }));
    body.append('rest', this.plan.rest);
    if (cage) body.append('cage', cage);
    const headers = { 'Idempotency-Key': key };
    return this.service.json<Session>('sessions', { method: 'POST', headers, body, signal });
  }

  private async prepared(id: string, signal: AbortSignal) {
    for (;;) {
      this.session = await this.retry(() => this.service.session(id, signal), signal);
      throwIfFailed(this.session);
      if (this.session.state !== 'preparing') break;
      this.changed();
      await pause(PREPARING_POLL_SECONDS, signal);
    }
    const { points } = this.session;
    if (points !== null && points !== this.plan.frames.points) {
      throw new Error(
        `The rest pose has ${points} points and the frames have ${this.plan.frames.points}: they must be the same mesh. Only the rest pose was uploaded.`,
      );
    }
  }

  private async send(id: string, signal: AbortSignal) {
    const { frames } = this.plan;
    const sender = this.sender(id);
    const backoff = new Backoff();
    if (this.session && this.session.frames.solved > 0 && this.done === 0) await this.recall(id, signal);
    // Whatever broke off, what is missing then is what the service says.
    for (;;) {
      const session = await this.retry(() => this.service.session(id, signal), signal);
      throwIfFailed(session);
      if (session.coding?.problem) throw problemFrom(session.coding.problem);
      this.session = session;
      const ranges = unsolved(session.frames, frames.frames);
      this.done = frames.frames - ranges.reduce((sum, [first, end]) => sum + end - first, 0);
      this.changed();
      if (session.state === 'completed' || ranges.length === 0) return;
      try {
        await sender.send(ranges, signal);
        backoff.reset();
      } catch (error) {
        const problem = problemBehind(error);
        if (!(problem instanceof ServiceProblem) || !problem.passes) throw problem;
        await this.wait({ problem, seconds: backoff.next(problem.retryAfter) }, signal);
      }
    }
  }

  /** Takes the errors of all frames as the service knows them. */
  private async recall(id: string, signal: AbortSignal) {
    for (const { frame, l2, linf } of await this.retry(() => this.service.errors(id, signal), signal)) {
      if (frame >= this.plan.frames.frames) continue;
      this.measured.l2[frame] = l2 ?? Number.NaN;
      this.measured.linf[frame] = linf ?? Number.NaN;
    }
  }

  private sender(id: string): FrameSender {
    return new FrameSender(this.service, sessionPath(id, 'frames'), this.plan.frames, {
      solved: (result) => {
        this.measured.l2[result.frame] = result.l2 ?? Number.NaN;
        this.measured.linf[result.frame] = result.linf ?? Number.NaN;
      },
      sent: (count, bytes) => {
        this.done += count;
        this.frames.add(count);
        this.bytes.add(bytes);
        this.trouble = '';
        this.changed();
      },
    });
  }

  private async retry<T>(work: () => Promise<T>, signal: AbortSignal): Promise<T> {
    const result = await persistently(work, { signal, onRetry: (retry) => this.say(retry) });
    this.trouble = '';
    return result;
  }

  private wait(retry: Retry, signal: AbortSignal): Promise<void> {
    this.say(retry);
    return pause(retry.seconds, signal);
  }

  private say({ problem, seconds }: Retry) {
    this.trouble = `${problem.message} Retrying in ${Math.ceil(seconds)} s.`;
    this.changed();
  }

  private enter(stage: Stage) {
    this.stage = stage;
    this.changed();
  }

  private changed() {
    this.dispatchEvent(new Event('change'));
  }
}
