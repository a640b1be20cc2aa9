/** A session that is still running, as a {@link Capture}: what is solved so far, live, until it is completed and read from its container. */

import type { Capture, FrameBlock, FrameErrors, LiveStatus, ModelSurface, StaticPart } from '../capture';
import { createCodec } from '../codec/client';
import type { Pictures } from '../container/pictures';
import type { Source } from '../container/source';
import { computePhi } from '../coordinates/pool';
import { nextEvent, persistently } from './backoff';
import { ClosedGroups } from './closedGroups';
import { CageRecordReader, RECORDS_MEDIA_TYPE } from './frameRecords';
import { FrameStore, GrowingErrors } from './frameStore';
import { LiveFollower } from './liveFollower';
import { type Session, solvedFromStart } from './messages';
import { isAbort, sentenceOf } from './problem';
import type { RunningContainer } from './runningContainer';
import { piecesOf } from './answers';
import { type Service, sessionPath } from './service';

/** A capture of a session; `live` while it is followed. */
export interface SessionCapture extends Capture {
  /** How the frames arrive; null of a session that was completed before it was opened. */
  readonly live: LiveStatus | null;
}

/**
 * Opens a completed session's container.
 *
 * @param known gives a source that reads what is here already from memory
 */
export type OpenFinished = (
  session: Session,
  signal: AbortSignal,
  known?: (source: Source) => Source,
) => Promise<Capture>;

/** Least seconds between two looks at the errors of all frames. */
const ERRORS_SECONDS = 5;

/**
 * Follows a session from the end of what is solved; earlier frames are fetched when they are looked at. Where frames are coded, groups of them come as
 * they close, residuals included, and take the place of the cages that were solved.
 */
export class LiveCapture implements SessionCapture {
  readonly events = new EventTarget();
  readonly name: string;
  static: StaticPart;
  frames: number;
  complete = false;
  private readonly id: string;
  private readonly store: FrameStore;
  private readonly measured = new GrowingErrors();
  private readonly follower: LiveFollower;
  /** Null where frames are not coded. */
  private readonly groups: ClosedGroups | null;
  private readonly fetching = new Map<number, Promise<void>>();
  private readonly closing = new AbortController();
  private finished: Capture | null = null;
  private lastProblem: string | null = null;
  private late = 0;
  private missingFrame: number | null = null;
  private coded = 0;
  /** What the errors were fetched for, and when: coding a group changes them, and frames passed over bring none. */
  private errorsFetched = { coded: -1, skipped: -1, at: -Infinity };

  /** @param openFinished opens the container, once there is one */
  constructor(
    private readonly service: Service,
    session: Session,
    private readonly running: RunningContainer,
    private readonly openFinished: OpenFinished,
  ) {
    const { part, connection } = running;
    this.id = session.id;
    this.name = session.name ?? session.id;
    this.static = part;
    this.frames = solvedFromStart(session.frames);
    this.store = new FrameStore(part.rowsPerFrame);
    this.follower = new LiveFollower(service, session.id, part.rowsPerFrame, this.frames, {
      record: (record) => {
        this.store.put(record.frame, record.rows);
        // Those of frames that are still to be coded are not those that they end with.
        if (!this.groups) this.measured.putRecord(record);
        this.frames = record.frame + 1;
      },
      skipped: (end) => (this.frames = end),
      looked: (look) => {
        this.missingFrame = look.frames.missing[0]?.[0] ?? null;
        this.coded = look.coding?.frames ?? 0;
        this.groups?.looked(look);
        void this.fetchErrors(look);
      },
      changed: () => this.changed(),
    });
    this.groups = session.coding ? this.followGroups(service, session, connection) : null;
    if (!this.groups) connection.stop.abort();
    void this.run();
  }

  get errors(): FrameErrors {
    return this.finished?.errors ?? this.measured.upTo(this.frames);
  }

  async surface(): Promise<ModelSurface | null> {
    const codec = createCodec();
    try {
      return await this.running.connection.stream.surface(this.static, codec);
    } finally {
      codec.close();
    }
  }

  pictures(): Promise<Pictures> {
    return this.running.connection.stream.pictures();
  }

  get frameNumbers(): Float64Array | null {
    return this.finished?.frameNumbers ?? null;
  }

  get frameBytes(): number | undefined {
    if (this.finished) return this.finished.frameBytes;
    const bytes = this.groups?.bytesPerFrame ?? null;
    return bytes === null ? undefined : bytes * this.frames;
  }

  get problem(): string | null {
    return this.finished?.problem ?? this.lastProblem ?? this.follower.problem;
  }

  get live(): LiveStatus {
    const follower = this.follower;
    const isOver = this.complete;
    return {
      state: isOver ? 'ended' : follower.state,
      retryAt: isOver ? null : follower.retryAt,
      latencySeconds: follower.latency.seconds,
      missingFrame: this.missingFrame,
      codedFrames: this.groups && this.coded,
      behindFrames: isOver ? 0 : follower.behind,
      bitsPerSecond: 8 * follower.bytes.perSecond(),
      framesPerSecond: follower.frames.perSecond(),
      lateFrames: this.late,
      droppedFrames: follower.skipped + follower.damaged,
    };
  }

  async block(frame: number, signal?: AbortSignal): Promise<FrameBlock> {
    let isLate = false;
    for (;;) {
      signal?.throwIfAborted();
      this.closing.signal.throwIfAborted();
      if (this.finished) return this.finished.block(frame, signal);
      const coded = await this.groups?.block(frame, signal);
      if (coded) return coded;
      const block = this.store.block(frame);
      if (block) return { ...block, isPreliminary: this.groups !== null };
      if (frame < this.frames) await this.fetchAround(frame);
      else if (this.complete)
        throw new RangeError(this.problem ?? `The capture has ${this.frames} frames, so there is no frame ${frame}.`);
      else {
        this.late += isLate ? 0 : 1;
        isLate = true;
        await nextEvent(signal, [this.events, 'change'], [this.closing.signal, 'abort']);
      }
    }
  }

  phi(onProgress: (fraction: number) => void, signal: AbortSignal): Promise<Float32Array> {
    const from = this.finished ?? this.groups;
    return from?.phi?.(onProgress, signal) ?? computePhi(this.static, { onProgress, signal });
  }

  readTogether(frame: number): { readonly first: number; readonly count: number } {
    return this.finished?.readTogether?.(frame) ?? this.groups?.of(frame) ?? { first: frame, count: 1 };
  }

  hasFinal(frame: number): boolean {
    return Boolean(this.finished ?? this.groups?.of(frame));
  }

  close() {
    this.closing.abort();
    this.groups?.close();
    this.finished?.close();
  }

  private async run() {
    const { signal } = this.closing;
    try {
      const session = await this.follower.run(signal);
      if (session) {
        const known = (source: Source): Source => this.groups?.source(source, session.coding?.frames ?? 0) ?? source;
        const opening = () => this.openFinished(session, signal, known);
        const onRetry = ({ problem }: { problem: Error }) => {
          this.lastProblem = problem.message;
          this.changed();
        };
        const finished = await persistently(opening, { signal, onRetry });
        this.lastProblem = null;
        finished.events.addEventListener('change', () => this.changed());
        // The meshes are the same; whoever made buffers of them can keep these.
        this.static = { ...this.static, report: finished.static.report };
        this.frames = finished.frames;
        this.finished = finished;
        this.groups?.close();
        // Coded cages are not quite the solved ones, and have residuals that belong to them.
        this.events.dispatchEvent(new Event('replaced'));
      }
    } catch (error) {
      if (signal.aborted) return;
      this.lastProblem = sentenceOf(error);
    }
    this.complete = true;
    this.changed();
  }

  private followGroups(service: Service, session: Session, connection: RunningContainer['connection']): ClosedGroups {
    return new ClosedGroups(service, session, this.static, connection, {
      arrived: () => this.changed(),
      failed: (error) => {
        this.lastProblem ??= sentenceOf(error);
        this.changed();
      },
    });
  }

  /** Fetches the frames of the chunk that has `frame`, once for all who wait for it. */
  private fetchAround(frame: number): Promise<void> {
    const { chunkFrames } = this.store;
    const chunk = Math.floor(frame / chunkFrames);
    const known = this.fetching.get(chunk);
    if (known) return known;
    const first = chunk * chunkFrames;
    const count = Math.min(chunkFrames, this.frames - first);
    const fetching = this.fetchFrames(first, count).finally(() => this.fetching.delete(chunk));
    this.fetching.set(chunk, fetching);
    return fetching;
  }

  private async fetchFrames(first: number, count: number) {
    const { signal } = this.closing;
    const path = `${sessionPath(this.id, 'cages')}?first=${first}&count=${count}`;
    const headers = { Accept: RECORDS_MEDIA_TYPE };
    await persistently(
      async () => {
        const reader = new CageRecordReader(this.static.rowsPerFrame);
        let received = 0;
        const response = await this.service.request(path, { headers, cache: 'no-store', signal });
        for await (const piece of piecesOf(response, signal)) {
          this.follower.bytes.add(piece.length);
          for (const { frame, rows } of reader.push(piece)) {
            if (frame < first || frame >= first + count) throw new Error('The service sent the wrong frame.');
            this.store.put(frame, rows);
            received += 1;
          }
        }
        if (received < count) throw new Error('The service sent too few frames.');
      },
      { signal, attempts: 4 },
    );
  }

  /** Fetches the errors of all frames where those here are not those any more. */
  private async fetchErrors(session: Session) {
    const coded = session.coding?.frames ?? 0;
    const { skipped } = this.follower;
    const fetched = this.errorsFetched;
    const now = performance.now();
    const isKnown = fetched.coded === coded && fetched.skipped === skipped;
    if (isKnown || session.frames.solved === 0 || now - fetched.at < 1000 * ERRORS_SECONDS) return;
    this.errorsFetched = { coded, skipped, at: now };
    try {
      for (const { frame, l2, linf } of await this.service.errors(this.id, this.closing.signal)) {
        if (!session.coding || frame < coded) this.measured.put(frame, l2, linf);
      }
      this.changed();
    } catch (error) {
      if (!isAbort(error)) this.errorsFetched = { coded: -1, skipped: -1, at: now };
    }
  }

  private changed() {
    this.events.dispatchEvent(new Event('change'));
  }
}
