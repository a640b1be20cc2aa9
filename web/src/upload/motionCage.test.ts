import { expect, test } from 'vitest';
import type { Service } from '../service/service';
import { KeptUpload, type UploadRecord } from './keptUpload';
import { MotionCage } from './motionCage';

test('a_design_that_was_begun_while_it_was_stopped_is_deleted', async () => {
  const requests: string[] = [];
  const stopping = new AbortController();
  const service = {
    // The service has begun the design; its answer comes after the stop.
    json: (path: string, { signal }: { signal: AbortSignal }) =>
      new Promise((resolve, reject) => {
        if (requests.push(path) > 1) signal.throwIfAborted();
        signal.addEventListener('abort', () => reject(signal.reason as Error));
        stopping.abort();
        setTimeout(() => resolve({ id: 'd-1' }), 50);
      }),
    request: (path: string, { method, signal }: { method?: string; signal?: AbortSignal }) => {
      signal?.throwIfAborted();
      requests.push(`${method} ${path}`);
      return Promise.resolve(new Response());
    },
  } as unknown as Service;
  const frames = { frames: 2, points: 1, read: () => Promise.resolve(new Float32Array(3)) };
  const kept = new KeptUpload({ key: 'k', session: null, design: null } as UploadRecord);
  const motion = { rest: new File([], 'rest.obj'), frames };
  const cage = new MotionCage(service, motion as never, kept, () => undefined);
  await expect(cage.design({ vertices: 10 }, (work) => work(), stopping.signal)).rejects.toThrow();
  expect(kept.present.design).toBe('d-1');
  await cage.putAway();
  expect(requests.at(-1)).toBe('DELETE cages/d-1');
});
