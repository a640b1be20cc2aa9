/** The page's side of decoding: the calls of `GroupDecoder`, answered by a worker. */

import { moduleWorker } from '../moduleWorker';
import { CodedDataError } from './error';
import type { Answer, Arguments, Call, Method, Result } from './messages';
import workerAddress from './worker.ts?worker&url';

/** Decodes the coded sections of one capture, one call after another. */
export interface Codec {
  /**
   * Calls a method of the capture's `GroupDecoder`.
   *
   * @param signal gives up a call that waits for others.
   */
  call<M extends Method>(method: M, args: Arguments<M>, signal?: AbortSignal): Promise<Result<M>>;
  /** Ends the worker; calls that wait fail. */
  close(): void;
}

/** A codec in a worker of its own, which the first call starts. */
export function createCodec(): Codec {
  return new WorkerCodec();
}

interface Waiting {
  readonly call: Call;
  readonly signal: AbortSignal | undefined;
  readonly resolve: (result: unknown) => void;
  readonly reject: (reason: Error) => void;
}

class WorkerCodec implements Codec {
  /** Started by the first call: captures without coded sections need none. */
  private worker: Worker | null = null;
  /** The first one is with the worker: what waits behind it can still be given up. */
  private readonly queue: Waiting[] = [];
  private nextId = 0;
  private failure: Error | null = null;

  call<M extends Method>(method: M, args: Arguments<M>, signal?: AbortSignal): Promise<Result<M>> {
    return new Promise((resolve, reject) => {
      if (this.failure !== null) {
        reject(this.failure);
        return;
      }
      const call = { id: this.nextId++, method, args };
      this.queue.push({ call, signal, resolve: resolve as (result: unknown) => void, reject });
      if (this.queue.length === 1) this.send();
    });
  }

  close(): void {
    this.fail(new DOMException('The capture was closed.', 'AbortError'));
  }

  private send(): void {
    for (let next = this.queue.at(0); next !== undefined; next = this.queue.at(0)) {
      if (next.signal?.aborted !== true) {
        this.worker ??= this.start();
        this.worker.postMessage(next.call);
        return;
      }
      next.reject(next.signal.reason as Error);
      this.queue.shift();
    }
  }

  private start(): Worker {
    const worker = moduleWorker(workerAddress, (error) => this.fail(error));
    worker.onmessage = ({ data }: MessageEvent<Answer>) => this.answer(data);
    return worker;
  }

  private answer(answer: Answer): void {
    const { resolve, reject } = this.queue.shift()!;
    if ('failure' in answer) reject(answer.damaged ? new CodedDataError(answer.failure) : new Error(answer.failure));
    else resolve(answer.result);
    this.send();
  }

  private fail(failure: Error): void {
    this.failure ??= failure;
    this.worker?.terminate();
    this.queue.splice(0).forEach(({ reject }) => reject(failure));
  }
}
