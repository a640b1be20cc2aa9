import '../workerStarted';
import { readSurface, NearestSurface } from './surface';
import { sentence } from '../text';
import type { Asked, Answer } from './surfaces';

/** Files of large surfaces are not read again while these are kept. */
const KEPT = 4;
const kept = new Map<number, NearestSurface>();

self.addEventListener('message', ({ data }: MessageEvent<Asked>) => {
  measure(data).then(
    (answer) => self.postMessage(answer),
    (error: unknown) => self.postMessage({ problem: sentence(error) }),
  );
});

async function measure({ frame, file, places }: Asked): Promise<Answer> {
  const found = kept.get(frame) ?? new NearestSurface(await readSurface(file));
  kept.delete(frame);
  kept.set(frame, found);
  for (const oldest of kept.keys()) {
    if (kept.size <= KEPT) break;
    kept.delete(oldest);
  }
  return { surface: found.surface, distances: found.distances(places) };
}
