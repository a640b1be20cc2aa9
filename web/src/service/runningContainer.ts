/** The container of a running session, which the service sends as it grows. */

import type { StaticPart } from '../capture';
import { createCodec } from '../codec/client';
import { ContainerStream } from '../container/stream';
import { piecesOf } from './answers';
import { ServiceProblem } from './problem';
import { type Service, sessionPath } from './service';

/** A connection by which the container arrives, from its front on. */
export interface ContainerConnection {
  readonly stream: ContainerStream;
  readonly pieces: AsyncGenerator<Uint8Array, void, undefined>;
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
  return { stream: new ContainerStream(), pieces: pieces(), stop };
}

/** Reads a running session's container as far as its model and cage, or a little further. */
export async function openRunning(service: Service, id: string, signal: AbortSignal): Promise<RunningContainer> {
  const connection = connect(service, id);
  const { stream, pieces, stop } = connection;
  const abort = () => stop.abort(signal.reason);
  signal.addEventListener('abort', abort);
  const codec = createCodec();
  try {
    signal.throwIfAborted();
    for (;;) {
      const { done, value } = await pieces.next();
      if (done) throw new ServiceProblem('unreachable', 0);
      if (stream.begin(value)) return { part: await stream.decodeStatic(codec), connection };
    }
  } catch (error) {
    stop.abort();
    throw error;
  } finally {
    signal.removeEventListener('abort', abort);
    codec.close();
  }
}
