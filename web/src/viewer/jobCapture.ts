import type { Capture } from '../capture';
import { pause, persistently } from '../service/backoff';
import { openStored, type OpenSessionOptions } from '../service/live';
import type { Recovery, Transfer } from '../service/messages';
import { problemFrom } from '../service/problem';
import { patiently, type Service } from '../service/service';
import { counted } from '../text';
import { correspondenceOf, trackingOf } from './reports';

const LOOK_SECONDS = 2;
/** How often in a row the service is asked while it does not answer. */
const ATTEMPTS = 5;

/** What of the service, beside sessions, ends with a container. */
export type JobKind = 'recovery' | 'transfer';

const PLACES: Readonly<Record<JobKind, string>> = { recovery: 'recoveries', transfer: 'transfers' };

/**
 * Opens what a recovery or a transfer has made, with what its report tells; waits until it is completed. Throws one sentence for a person where it
 * failed.
 */
export async function jobCapture(
  kind: JobKind,
  id: string,
  { service, signal, onWaiting }: OpenSessionOptions & { readonly service: Service },
): Promise<Capture> {
  const path = `${PLACES[kind]}/${encodeURIComponent(id)}`;
  const json = <T>(below: string): Promise<T> =>
    persistently(() => service.json<T>(path + below, { cache: 'no-store', signal: patiently(signal) }), {
      signal,
      attempts: ATTEMPTS,
    });
  for (;;) {
    const job = await json<Recovery | Transfer>('');
    if (job.problem) throw problemFrom(job.problem);
    if (job.state === 'completed') {
      const report = await json<unknown>('/report');
      const options = { name: job.name ?? id, ...(signal && { signal }) };
      const capture = await openStored(service, `${path}/capture.cager`, options);
      if (kind === 'recovery') capture.tracking = trackingOf(report, capture.frames);
      else capture.correspondence = correspondenceOf(report);
      capture.identity = `${kind} ${service.address(path)}`;
      return capture;
    }
    onWaiting?.(progressOf(job));
    await pause(LOOK_SECONDS, signal);
  }
}

/** How far a job is, in a sentence. */
function progressOf(job: Recovery | Transfer): string {
  if ('moved' in job)
    return `Transferred ${job.moved} of ${counted(job.frames, 'frame')}. Playback starts when all are encoded.`;
  const { followed, received } = job.frames;
  return job.state === 'finishing' && followed === received
    ? 'Refining all frames; playback starts when this is done.'
    : `Recovered ${followed} of ${counted(received, 'frame')}. Playback starts when all are done.`;
}
