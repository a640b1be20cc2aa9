/** Posts frames in batches of a size that suits the connection, two at a time so that the service never waits for the page. */

import type { FrameResult } from '../service/messages';
import { type ProblemDetails, ServiceProblem, problemBehind, problemFrom } from '../service/problem';
import type { Service } from '../service/service';
import { textOf } from '../service/answers';
import type { FrameSource } from '../files/frameSource';

const AT_ONCE = 2;
const FIRST_BYTES = 1 << 20;
const MAX_BYTES = 16 << 20;
/** How long a batch should take: long enough to be worth a request, short enough for progress to be seen. */
const BATCH_SECONDS = 1.5;

export interface Heard {
  /** A frame is solved and on the service's disk. */
  readonly solved: (result: FrameResult) => void;
  /** A batch is acknowledged: so many frames, so many bytes. */
  readonly sent: (frames: number, bytes: number) => void;
}

export class FrameSender {
  private batchBytes = FIRST_BYTES;
  /** Less than {@link MAX_BYTES} where something on the way takes no larger bodies. */
  private mostBytes = MAX_BYTES;

  /** @param path of the session's frames */
  constructor(
    private readonly service: Service,
    private readonly path: string,
    private readonly source: FrameSource,
    private readonly heard: Heard,
  ) {}

  /** Posts the frames of these ranges `[a, b)`. After a failure some of them may have arrived: the service knows which. */
  async send(ranges: readonly (readonly [number, number])[], signal: AbortSignal) {
    const failed = new AbortController();
    const either = AbortSignal.any([signal, failed.signal]);
    const batches = this.batches(ranges);
    const work = async () => {
      for (const [first, count] of batches) await this.postSplit(first, count, either);
    };
    const failures: Error[] = [];
    const note = (error: unknown) => {
      failures.push(problemBehind(error));
      failed.abort();
    };
    await Promise.all(Array.from({ length: AT_ONCE }, () => work().catch(note)));
    // The other worker's abort is a consequence of the first failure.
    if (failures.length > 0) throw failures[0];
  }

  /** The next batch is as large as the connection suggests at the time it is taken. A generator may be shared by those who take from it. */
  private *batches(ranges: readonly (readonly [number, number])[]): Generator<[number, number], void, undefined> {
    for (const [begin, end] of ranges) {
      for (let first = begin; first < end;) {
        const count = Math.min(end - first, Math.max(1, Math.floor(this.batchBytes / this.frameBytes)));
        yield [first, count];
        first += count;
      }
    }
  }

  private get frameBytes(): number {
    return 12 * this.source.points;
  }

  /** Posts frames, fewer at a time where a proxy refuses so many. */
  private async postSplit(first: number, count: number, signal: AbortSignal): Promise<void> {
    try {
      await this.post(first, count, signal);
    } catch (error) {
      if (!(error instanceof ServiceProblem && error.status === 413) || count === 1) throw error;
      const half = Math.ceil(count / 2);
      this.mostBytes = Math.min(this.mostBytes, half * this.frameBytes);
      this.batchBytes = Math.min(this.batchBytes, this.mostBytes);
      await this.postSplit(first, half, signal);
      await this.postSplit(first + half, count - half, signal);
    }
  }

  private async post(first: number, count: number, signal: AbortSignal) {
    const body = await this.source.read(first, count);
    const began = performance.now();
    const response = await this.service.request(`${this.path}?first=${first}`, {
      method: 'POST',
      headers: { 'Content-Type': 'application/octet-stream', Accept: 'application/x-ndjson' },
      body: body as Float32Array<ArrayBuffer>,
      signal,
    });
    for (const line of (await textOf(response, signal)).split('\n')) {
      if (line === '') continue;
      const result = JSON.parse(line) as FrameResult | ProblemDetails;
      // An error after the first result has no status of its own; it is the last line.
      if ('type' in result) throw problemFrom(result);
      this.heard.solved(result as FrameResult);
    }
    this.heard.sent(count, body.byteLength);
    this.adapt(body.byteLength, (performance.now() - began) / 1000);
  }

  private adapt(bytes: number, seconds: number) {
    const wanted = (bytes / Math.max(seconds, 0.01)) * BATCH_SECONDS;
    // Half of the way, so that one slow answer does not change much.
    const next = (this.batchBytes + Math.min(this.mostBytes, wanted)) / 2;
    this.batchBytes = Math.max(this.frameBytes, Math.min(2 * this.batchBytes, next));
  }
}
