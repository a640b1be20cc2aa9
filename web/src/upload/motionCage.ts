/** Cages that the service designs from the motion of a capture. */

import { pause } from '../service/backoff';
import type { CageDesign, DesignOptions } from '../service/messages';
import { ServiceProblem, problemBehind, problemFrom } from '../service/problem';
import { type Service, patiently } from '../service/service';
import { checkReadable, type FrameSource } from '../files/frameSource';
import { bodyOf } from '../service/answers';
import type { KeptUpload } from './keptUpload';

/** A design looks at no more frames. */
const MAX_FRAMES = 160;
/** Of large models fewer frames are sent: they show as much of the motion. */
const MAX_BYTES = 192 << 20;
const MIN_FRAMES = 24;
/** How long a request that begins a design may still be answered after nobody wants it, in milliseconds. */
const ANSWER_MS = 2000;
const LOOK_SECONDS = 1;

/** Repeats what fails and may be repeated. */
type Retrying = <T>(work: () => Promise<T>) => Promise<T>;

export function sampledFrames(frames: number, points: number): number[] {
  const room = Math.max(MIN_FRAMES, Math.floor(MAX_BYTES / (12 * points)));
  const sampled = Math.min(frames, MAX_FRAMES, room);
  return Array.from({ length: sampled }, (_, k) => Math.round((k * (frames - 1)) / Math.max(1, sampled - 1)));
}

interface Motion {
  readonly rest: File;
  readonly frames: FrameSource;
}

export class MotionCage {
  /** How far it is; null while none is at work. */
  progress: CageDesign | null = null;
  /** The best cage so far, where somebody did not want to wait for the end. */
  file: File | null = null;
  private enough = new AbortController();

  /** @param kept says which design is at work, also after the page was closed */
  constructor(
    private readonly service: Service,
    private readonly motion: Motion,
    private readonly kept: KeptUpload,
    private readonly onProgress: () => void,
  ) {}

  /**
   * Waits until the cage is designed; a design that is at work is gone on with.
   *
   * @throws ServiceProblem where there can be no cage
   */
  async design(options: DesignOptions, retry: Retrying, signal: AbortSignal) {
    this.enough = new AbortController();
    const { key, design } = this.kept.present;
    const begin = async (): Promise<string> => {
      const id = await retry(() => beginDesign(this.service, this.motion, options, `${key}-cage`, signal));
      this.kept.set({ design: id });
      return id;
    };
    let id = design ?? (await begin());
    try {
      await this.follow(id, retry, signal).catch(async (error: unknown) => {
        const problem = problemBehind(error);
        if (design === null || !(problem instanceof ServiceProblem && problem.isGone)) throw problem;
        id = await begin();
        await this.follow(id, retry, signal);
      });
    } catch (error) {
      if (signal.aborted || !this.enough.signal.aborted) throw error;
      this.file = await retry(() => bestCage(this.service, id, signal));
      await this.putAway();
    }
    this.progress = null;
  }

  /** Goes on with the best cage so far. */
  takeBest() {
    this.enough.abort();
  }

  /** Deletes the design, which stops it and makes room; a session that took its cage keeps that. */
  async putAway() {
    const { design } = this.kept.present;
    if (design === null) return;
    await removeDesign(this.service, design);
    this.kept.set({ design: null });
    this.progress = null;
  }

  /** Looks at a design until it is completed; throws where it failed, is gone or was enough. */
  private async follow(id: string, retry: Retrying, signal: AbortSignal) {
    const either = AbortSignal.any([signal, this.enough.signal]);
    for (;;) {
      const found = await retry(() => readDesign(this.service, id, either));
      either.throwIfAborted();
      if (found.problem) throw problemFrom(found.problem);
      if (found.state === 'completed') return;
      this.progress = found;
      this.onProgress();
      await pause(LOOK_SECONDS, either);
    }
  }
}

/** Begins a design, or finds the one that was begun with the same key; its identifier. */
async function beginDesign(
  service: Service,
  { rest, frames }: Motion,
  options: DesignOptions,
  key: string,
  signal: AbortSignal,
): Promise<string> {
  const numbers = sampledFrames(frames.frames, frames.points);
  const pieces: Blob[] = [];
  for (const frame of numbers) {
    signal.throwIfAborted();
    pieces.push(new Blob([(await frames.read(frame, 1)) as Float32Array<ArrayBuffer>]));
  }
  await checkReadable([rest]);
  const body = new FormData();
  body.append('options', JSON.stringify({ ...options, frames: numbers.length }));
  body.append('rest', rest);
  body.append('frames', new Blob(pieces), 'frames.f32');
  const headers = { 'Idempotency-Key': key };
  return (await service.json<CageDesign>('cages', { method: 'POST', headers, body, signal: answered(signal) })).id;
}

/** Aborted a little after another one, so that what the service has just begun is known, and can be deleted. */
function answered(signal: AbortSignal): AbortSignal {
  const late = new AbortController();
  const abort = () => setTimeout(() => late.abort(signal.reason), ANSWER_MS);
  signal.addEventListener('abort', abort, { once: true });
  return late.signal;
}

async function bestCage(service: Service, id: string, signal: AbortSignal): Promise<File> {
  const response = await service.request(`${pathOf(id)}/cage.obj`, { cache: 'no-store', signal });
  return new File([await bodyOf(response, signal)], 'cage.obj');
}

export function readDesign(service: Service, id: string, signal?: AbortSignal): Promise<CageDesign> {
  return service.json(pathOf(id), { cache: 'no-store', signal: patiently(signal) });
}

/** Deletes a design; that it could not be is no failure. */
export async function removeDesign(service: Service, id: string) {
  await service.request(pathOf(id), { method: 'DELETE' }).catch(() => undefined);
}

function pathOf(id: string): string {
  return `cages/${encodeURIComponent(id)}`;
}
