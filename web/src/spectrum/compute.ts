import type { Capture, TriangleMesh } from '../capture';
import { canCompute } from '../coordinates/compute';
import { moduleWorker } from '../moduleWorker';
import type { SpectrumAnswer, SpectrumRequest } from './messages';
import type { Spectrum } from './singular';
import workerAddress from './worker.ts?worker&url';

/** Rows of a cage beyond which their eigenvectors would take minutes. */
const MAX_ROWS = 1500;

/** Spectra that were computed, by the cages they belong to. */
const computed = new WeakMap<TriangleMesh, Spectrum>();

/**
 * Singular values and vectors of a capture's Φ, computed in a worker, once for each capture: of the columns that the stored rows belong to.
 *
 * @throws Error with one sentence for a person where Φ cannot be had or is too large
 */
export async function computeSpectrum(
  capture: Capture,
  onProgress: (fraction: number) => void,
  signal: AbortSignal,
): Promise<Spectrum> {
  const { system, cage, rest, rowsPerFrame: rows } = capture.static;
  const known = computed.get(cage);
  if (known) return known;
  const isComputed = canCompute(system);
  if (!isComputed && !capture.coordinates) {
    throw new Error(
      'Singular values need the coordinates of the points. Harmonic ones are computed by the service alone: open the capture as a session.',
    );
  }
  if (rows > MAX_ROWS) {
    throw new Error(`This cage has ${rows} unknowns; singular values are computed here for up to ${MAX_ROWS}.`);
  }
  const fetched = isComputed ? 0 : 0.5;
  const phi = isComputed ? null : await capture.coordinates!((fraction) => onProgress(fraction * fetched), signal);
  const onSummed = (fraction: number) => onProgress(fetched + (1 - fetched) * fraction);
  const spectrum = await inWorker({ system, cage, rest, rows, phi }, onSummed, signal);
  computed.set(cage, spectrum);
  return spectrum;
}

async function inWorker(
  request: SpectrumRequest,
  onProgress: (fraction: number) => void,
  signal: AbortSignal,
): Promise<Spectrum> {
  signal.throwIfAborted();
  const worker = moduleWorker(workerAddress);
  try {
    return await new Promise<Spectrum>((resolve, reject) => {
      signal.addEventListener('abort', () => reject(signal.reason as Error), { once: true });
      worker.onmessage = ({ data }: MessageEvent<SpectrumAnswer>) => {
        if (data.kind === 'progress') onProgress(data.fraction);
        else if (data.kind === 'spectrum') resolve(data.spectrum);
        else reject(new Error(data.problem));
      };
      worker.onerror = () => reject(new Error('Computing singular values failed in this browser; reload the page.'));
      worker.postMessage(request);
    });
  } finally {
    worker.terminate();
  }
}
