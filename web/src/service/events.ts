/** Events of sessions and of designs, followed over broken connections and restarts of the service. */

import { Backoff, pause } from './backoff';
import type { Progress } from './messages';
import { ServiceProblem, problemBehind } from './problem';
import { piecesOf } from './answers';
import { type Service } from './service';
import { EventParser } from './sse';

/**
 * Tells `onProgress` of every change of a session, or of a design, until it is completed or failed, whatever breaks in between.
 *
 * @param path address of it, such as `sessionPath` gives
 * @returns the last of them
 * @throws ServiceProblem where it cannot go on: it was deleted, the token is refused
 */
export async function followProgress<T extends { readonly state: string } = Progress>(
  service: Service,
  path: string,
  onProgress: (progress: T) => void,
  signal: AbortSignal,
): Promise<T> {
  const backoff = new Backoff();
  let last = '';
  for (;;) {
    try {
      const headers = new Headers({ Accept: 'text/event-stream' });
      if (last !== '') headers.set('Last-Event-ID', last);
      const response = await service.request(`${path}/events`, { headers, cache: 'no-store', signal });
      const [parser, text] = [new EventParser(), new TextDecoder()];
      for await (const piece of piecesOf(response, signal)) {
        for (const event of parser.push(text.decode(piece, { stream: true }))) {
          backoff.reset();
          last = event.id || last;
          if (event.type === 'deleted') throw new ServiceProblem('session-deleted', 410);
          if (event.type !== 'progress') continue;
          const progress = JSON.parse(event.data) as T;
          onProgress(progress);
          if (progress.state === 'completed' || progress.state === 'failed') return progress;
        }
      }
      await pause(backoff.next(), signal);
    } catch (error) {
      const problem = problemBehind(error);
      if (!(problem instanceof ServiceProblem) || !problem.passes) throw problem;
      await pause(backoff.next(problem.retryAfter), signal);
    }
  }
}
