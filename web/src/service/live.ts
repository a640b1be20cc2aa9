/** Opens a session as a capture, whatever state it is in. */

import type { Capture } from '../capture';
import { openContainer, type OpenOptions } from '../container/open';
import type { Source } from '../container/source';
import { type Retry, pause, persistently } from './backoff';
import { basisRows } from './basisRows';
import { LiveCapture, type OpenFinished, type SessionCapture } from './liveCapture';
import { type Session, throwIfFailed } from './messages';
import { ServiceProblem, problemBehind } from './problem';
import { openRunning } from './runningContainer';
import { Service, sessionPath } from './service';
import { pageToken } from './token';

export type { SessionCapture } from './liveCapture';

export interface OpenSessionOptions {
  readonly service?: Service;
  readonly signal?: AbortSignal;
  /** Hears a sentence about what is waited for, such as a session that is being prepared; empty when it goes on. */
  readonly onWaiting?: (sentence: string) => void;
}

const PREPARING_SECONDS = 1;
/** How often in a row opening is tried while the service does not answer. */
const ATTEMPTS = 5;

/**
 * Opens the session `id` of the service beside the page. A completed one is read from its container by ranges. Of a running one the static part comes
 * from the front of its container, and its cages as they are solved, with coded groups as they close; when it is completed, the same capture goes on as that
 * of its container.
 *
 * @throws ServiceProblem where there is no such session, it failed, or the service wants a token; its message is a sentence to show
 */
export async function openSession(id: string, options: OpenSessionOptions = {}): Promise<SessionCapture> {
  const { service = new Service(), signal = new AbortController().signal, onWaiting } = options;
  const onRetry = ({ problem }: Retry) => onWaiting?.(problem.message);
  const retried = <T>(work: () => Promise<T>): Promise<T> =>
    persistently(work, { signal, onRetry, attempts: ATTEMPTS });
  const open: OpenFinished = (...finished) => openFinished(service, ...finished);
  const session = await whenPrepared(() => retried(() => service.session(id, signal)), onWaiting, signal);
  if (session.state === 'completed') return Object.assign(await retried(() => open(session, signal)), { live: null });
  const running = await retried(() => openRunning(service, id, signal));
  onWaiting?.('');
  try {
    // Frames were solved while the static part came.
    return new LiveCapture(service, await retried(() => service.session(id, signal)), running, open);
  } catch (error) {
    running.connection.stop.abort();
    throw error;
  }
}

async function whenPrepared(
  look: () => Promise<Session>,
  onWaiting: OpenSessionOptions['onWaiting'],
  signal: AbortSignal,
): Promise<Session> {
  for (;;) {
    const session = await look();
    throwIfFailed(session);
    if (session.state !== 'preparing') return session;
    onWaiting?.('Preparing the session. Large models can take minutes.');
    await pause(PREPARING_SECONDS, signal);
  }
}

/** The capture in a completed session's container, read by ranges as far as it is not here already. */
async function openFinished(
  service: Service,
  session: Session,
  signal: AbortSignal,
  known?: (source: Source) => Source,
): Promise<Capture> {
  // The page cannot compute these coordinates, and coded cages are decoded with them.
  const coordinates = session.coordinates === 'harmonic' ? basisRows(service, session.id, signal) : null;
  const options = { name: session.name ?? session.id, signal, ...(coordinates && { coordinates }) };
  return openStored(service, sessionPath(session.id, 'capture.cager'), options, known);
}

/** The capture in a container that the service has at `path`, which does not change any more; `known` adds what is here already. */
export async function openStored(
  service: Service,
  path: string,
  options: OpenOptions,
  known: (source: Source) => Source = (source) => source,
): Promise<Capture> {
  try {
    return await openContainer(known(steady(await service.source(path, options.signal))), options);
  } catch (error) {
    throw told(error);
  }
}

/** The same source, read again where the network fails; says that a token is wanted where it is refused later, while the capture is played. */
function steady(source: Source): Source {
  const read = (first: number, bytes: number, signal?: AbortSignal): Promise<Uint8Array> =>
    persistently(() => source.read(first, bytes, signal), { signal, attempts: ATTEMPTS }).catch((error: unknown) => {
      told(error);
      throw error;
    });
  return { size: source.size, read };
}

/** The problem behind an error; the page hears of one that a token solves. */
function told(error: unknown): Error {
  const problem = problemBehind(error);
  if (problem instanceof ServiceProblem && problem.status === 401) pageToken.refused();
  return problem;
}
