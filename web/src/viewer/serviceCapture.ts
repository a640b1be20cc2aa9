import type { Capture } from '../capture';
import { openSession, type OpenSessionOptions, openStored } from '../service/live';
import { type Service, sessionPath, patiently } from '../service/service';
import { pause, persistently } from '../service/backoff';
import type { Recovery, Transfer } from '../service/messages';
import { problemFrom } from '../service/problem';
import { download, FORMATS, type Format } from '../sessions/download';
import { counted } from '../text';
import { correspondenceOf, trackingOf } from './reports';

/** Opens a session, with what the service does for it: coordinates, handles, its container and decoding. */
export async function sessionCapture(
  id: string,
  options: OpenSessionOptions & { readonly service: Service },
): Promise<Capture> {
  const { service } = options;
  const capture: Capture = await openSession(id, options);
  const below = (path: string) => sessionPath(id, path);
  capture.coordinates = async (onProgress, until) => (await service.coordinates(id, onProgress, until)).values;
  capture.container ??= (until) => service.source(below('capture.cager'), until);
  capture.decode = (cages, until) => {
    const headers = { 'Content-Type': 'application/octet-stream' };
    return service.request(below('decode'), { method: 'POST', headers, body: cages, signal: until ?? null });
  };
  capture.handles = (until) => service.handles(id, until);
  capture.downloads = {
    formats: FORMATS,
    save: (ending, name, onProgress) => download(service, id, name, ending as Format, onProgress),
  };
  capture.session = id;
  capture.identity = `session ${service.address(sessionPath(id))}`;
  return capture;
}

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

function progressOf(job: Recovery | Transfer): string {
  if ('moved' in job)
    return `Transferred ${job.moved} of ${counted(job.frames, 'frame')}. Playback starts when all are encoded.`;
  const { followed, received } = job.frames;
  return job.state === 'finishing' && followed === received
    ? 'Refining all frames; playback starts when this is done.'
    : `Recovered ${followed} of ${counted(received, 'frame')}. Playback starts when all are done.`;
}
