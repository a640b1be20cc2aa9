/** The container of a running session, which the service sends as it grows. */

import type { StaticPart } from '../capture';
import { createCodec } from '../codec/client';
import { StaticStream } from '../container/stream';
import { ServiceProblem } from './problem';
import { piecesOf } from './answers';
import { type Service, sessionPath } from './service';

/** A connection by which the container arrives, from its front on. */
export interface ContainerConnection {
  /** The pieces that are read already. */
  readonly begun: readonly Uint8Array[];
  /** Those that follow. */
  readonly pieces: AsyncGenerator<Uint8Array, void, undefined>;
  /** Ends it. */
  readonly stop: AbortController;
}

/** Model and cage of a running session: what its container begins with. */
export interface RunningContainer {
  readonly part: StaticPart;
  /** Stopped by whoever does not read on. */
  readonly connection: ContainerConnection;
}

/** Asks for the container from its front; the request is made when the first piece is asked for. */
export function connect(service: Service, id: string): ContainerConnection {
  const stop = new AbortController();
  const path = `${sessionPath(id, 'capture.cager')}?follow=true`;
  async function* pieces(): AsyncGenerator<Uint8Array, void, undefined> {
    yield* piecesOf(await service.request(path, { cache: 'no-store', signal: stop.signal }), stop.signal);
  }
  return { begun: [], pieces: pieces(), stop };
}

/** Reads a running session's container as far as its model and cage, or a little further. */
export async function openRunning(service: Service, id: string, signal: AbortSignal): Promise<RunningContainer> {
  const { pieces, stop } = connect(service, id);
  const abort = (): void => stop.abort(signal.reason);
  signal.addEventListener('abort', abort);
  const codec = createCodec();
  const stream = new StaticStream(codec);
  try {
    signal.throwIfAborted();
    const begun: Uint8Array[] = [];
    for (;;) {
      const { done, value } = await pieces.next();
      if (done) throw new ServiceProblem('unreachable', 0);
      begun.push(value);
      const part = await stream.push(value);
      if (part) return { part, connection: { begun, pieces, stop } };
    }
  } catch (error) {
    stop.abort();
    throw error;
  } finally {
    signal.removeEventListener('abort', abort);
    codec.close();
  }
}
