/** Receives the cages of a running session as they are solved, over broken connections and restarts of the service. */

import type { LiveStatus } from '../capture';
import { Backoff, nextEvent, pause } from './backoff';
import { BrokenRecord, type CageRecord, CageRecordReader, RECORDS_MEDIA_TYPE } from './frameRecords';
import { LatencyMeter, RateMeter } from './measures';
import { type Session, solvedFromStart, throwIfFailed } from './messages';
import { ServiceProblem, problemBehind } from './problem';
import { piecesOf } from './answers';
import { type Service, sessionPath } from './service';
import { pageToken } from './token';

const LOOK_SECONDS = 3;
/** The first look shows the delay soon. */
const FIRST_LOOK_SECONDS = 0.5;
/** After so many looks at the session without an answer, the stream is taken for dead: a lost network does not end it. */
const MAX_SILENT_LOOKS = 2;
/** Live pictures that are later than this go on at the newest frame, and leave out those between. */
const MAX_BEHIND_SECONDS = 6;
const MIN_SKIPPED = 30;

/** Why the stream is left: the page goes on at the newest frame. */
class TooFarBehind extends Error {}

export interface Following {
  readonly record: (record: CageRecord) => void;
  /** Frames up to `end` are solved, and will not be sent unless they are asked for. */
  readonly skipped: (end: number) => void;
  readonly looked: (session: Session) => void;
  readonly changed: () => void;
}

export class LiveFollower {
  state: LiveStatus['state'] = 'following';
  retryAt: number | null = null;
  /** Why nothing follows at the moment, or at all. */
  problem: string | null = null;
  damaged = 0;
  skipped = 0;
  behind = 0;
  readonly bytes = new RateMeter();
  readonly frames = new RateMeter();
  readonly latency = new LatencyMeter();
  private readonly backoff = new Backoff();
  private next: number;
  /** How far behind the page was at the last look; a skip needs two that do not get better. */
  private behindBefore = 0;

  /** @param next the first frame to receive */
  constructor(
    private readonly service: Service,
    private readonly id: string,
    private readonly rows: number,
    next: number,
    private readonly following: Following,
  ) {
    this.next = next;
  }

  /**
   * Follows until the session is completed, which it returns, or until it failed or is gone, when `problem` says why and it returns null.
   *
   * @throws an abort of `signal`
   */
  async run(signal: AbortSignal): Promise<Session | null> {
    for (;;) {
      try {
        const session = await this.service.session(this.id, signal);
        this.following.looked(session);
        throwIfFailed(session);
        if (session.state === 'completed') return session;
        this.catchUp(session);
        this.latency.reset(this.next);
        await this.receive(signal);
        // It ended by itself: the session is completed or deleted, or something in between closed the connection.
        await pause(this.backoff.next(), signal);
      } catch (error) {
        if (signal.aborted) throw error;
        if (!(await this.recovers(problemBehind(error), signal))) return null;
      }
    }
  }

  /** Waits where that may help; otherwise nothing follows any more. */
  private async recovers(problem: Error, signal: AbortSignal): Promise<boolean> {
    if (problem instanceof TooFarBehind) return true;
    this.problem = problem.message;
    if (problem instanceof ServiceProblem && problem.status === 401) {
      this.enter('signed-out');
      await tokenChange(signal);
      this.enter('reconnecting');
      return true;
    }
    if (!(problem instanceof BrokenRecord) && !(problem instanceof ServiceProblem && problem.passes)) {
      this.enter('ended');
      return false;
    }
    const seconds = this.backoff.next(problem instanceof ServiceProblem ? problem.retryAfter : null);
    this.retryAt = Date.now() + 1000 * seconds;
    this.enter('reconnecting');
    await pause(seconds, signal);
    return true;
  }

  private async receive(signal: AbortSignal) {
    const left = new AbortController();
    const either = AbortSignal.any([signal, left.signal]);
    const response = await this.service.request(`${sessionPath(this.id, 'cages')}?follow=true&first=${this.next}`, {
      headers: { Accept: RECORDS_MEDIA_TYPE },
      cache: 'no-store',
      signal: either,
    });
    this.problem = null;
    this.retryAt = null;
    this.enter('following');
    const looking = new AbortController();
    void this.lookOn(left, AbortSignal.any([either, looking.signal]));
    const reader = new CageRecordReader(this.rows);
    try {
      for await (const piece of piecesOf(response, either)) {
        this.backoff.reset();
        this.bytes.add(piece.length);
        for (const record of reader.push(piece)) this.take(record);
        this.following.changed();
      }
    } catch (error) {
      if (error instanceof BrokenRecord) this.damaged += 1;
      throw error;
    } finally {
      looking.abort();
    }
    either.throwIfAborted();
  }

  private take(record: CageRecord) {
    // Frames come in order; anything else is another session's, or a fault on the way.
    if (record.frame !== this.next) throw new BrokenRecord('A frame arrived out of order.');
    this.next += 1;
    this.frames.add(1);
    this.latency.arrived(record.frame);
    this.behind = Math.max(0, this.behind - 1);
    this.following.record(record);
  }

  /** Looks at the session every few seconds while its cages arrive: for the delay, for its errors, and for signs of life. */
  private async lookOn(left: AbortController, signal: AbortSignal) {
    let unanswered = 0;
    try {
      for (let wait = FIRST_LOOK_SECONDS; ; wait = LOOK_SECONDS) {
        await pause(wait, signal);
        const from = performance.now();
        const session = await this.service
          .session(this.id, AbortSignal.any([signal, AbortSignal.timeout(1000 * LOOK_SECONDS)]))
          .catch(() => null);
        signal.throwIfAborted();
        unanswered = session === null ? unanswered + 1 : 0;
        if (unanswered >= MAX_SILENT_LOOKS) left.abort(new ServiceProblem('unreachable', 0));
        if (session === null) continue;
        const solved = solvedFromStart(session.frames);
        if (solved > 0) this.latency.looked(from, performance.now(), solved - 1);
        this.behind = Math.max(0, solved - this.next);
        this.following.looked(session);
        this.following.changed();
        if (this.isHopeless()) left.abort(new TooFarBehind());
      }
    } catch {
      // The stream ended or was left.
    }
  }

  /** Whether frames are solved faster than they arrive, and the page is seconds behind. */
  private isHopeless(): boolean {
    const getsBetter = this.behind < 0.8 * this.behindBefore;
    this.behindBefore = this.behind;
    const rate = this.frames.perSecond();
    return !getsBetter && this.behind > MIN_SKIPPED && this.behind > MAX_BEHIND_SECONDS * rate;
  }

  /** After a break, and where the connection is too slow, goes on with the newest frame. */
  private catchUp(session: Session) {
    const solved = solvedFromStart(session.frames);
    this.behind = Math.max(0, solved - this.next);
    const rate = this.frames.perSecond();
    if (this.behind <= MIN_SKIPPED || this.behind <= MAX_BEHIND_SECONDS * rate) return;
    this.skipped += this.behind;
    this.behind = 0;
    this.behindBefore = 0;
    this.next = solved;
    this.following.skipped(solved);
  }

  private enter(state: LiveStatus['state']) {
    this.state = state;
    this.following.changed();
  }
}

async function tokenChange(signal: AbortSignal) {
  do await nextEvent(signal, [pageToken, 'change']);
  while (pageToken.token === null);
}
