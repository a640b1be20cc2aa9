import type { StaticPart } from '../capture';
import { columnsOf, MAX_PHI_BYTES } from './compute';
import type { FromWorker, ToWorker } from './messages';
import { moduleWorker } from '../moduleWorker';
import workerAddress from './worker.ts?worker&url';

/** Entries of Φ that a worker computes before it reports: some tens of milliseconds of work. */
const SLICE_ENTRIES = 1 << 17;
/** More workers hardly help: the rows have to be copied into one array. */
const MAX_WORKERS = 8;

/** Milliseconds between reports: drawing each of them would take the processor from the computation. */
const REPORT_EVERY = 200;

/** What a computation of Φ reports and heeds. */
export interface ComputeOptions {
  readonly signal?: AbortSignal;
  /** Called with the fraction of the rows that are there. */
  readonly onProgress?: (fraction: number) => void;
}

/**
 * Computes Φ in web workers, in double precision, rounded to single at the end: points × columns, row-major.
 *
 * Rejects with the signal's reason when aborted, and with one sentence for a person where Φ does not fit into memory or does not exist.
 */
export async function computePhi(capture: StaticPart, options: ComputeOptions = {}): Promise<Float32Array> {
  const { signal, onProgress } = options;
  signal?.throwIfAborted();
  const points = capture.rest.length / 3;
  const columns = columnsOf(capture.system, capture.cage);
  const phi = allocate(points, columns);
  if (points === 0) return phi;
  const slice = Math.max(1, Math.floor(SLICE_ENTRIES / columns));
  const slices = Math.ceil(points / slice);
  const count = Math.min(MAX_WORKERS, slices, Math.max(1, navigator.hardwareConcurrency));
  const workers = Array.from({ length: count }, startWorker);
  try {
    await new Promise<void>((resolve, reject) => {
      let [sent, done, reported] = [0, 0, performance.now()];
      const sendNext = (worker: Worker) => {
        if (sent >= slices) return;
        const first = sent++ * slice;
        send(worker, { kind: 'points', first, points: capture.rest.slice(3 * first, 3 * (first + slice)) });
      };
      signal?.addEventListener('abort', () => reject(signal.reason as Error), { once: true });
      for (const worker of workers) {
        worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
          if (data.kind === 'failed') {
            reject(new Error(data.problem));
            return;
          }
          phi.set(data.rows, data.first * columns);
          done++;
          if (performance.now() - reported >= REPORT_EVERY) {
            reported = performance.now();
            onProgress?.(done / slices);
          }
          if (done === slices) resolve();
          else sendNext(worker);
        };
        worker.onerror = () => reject(new Error('Computing the coordinates failed in this browser; reload the page.'));
        const { positions, triangles } = capture.cage;
        send(worker, { kind: 'cage', system: capture.system, positions, triangles });
        // Two slices each, so that no worker waits for its next one.
        sendNext(worker);
        sendNext(worker);
      }
    });
  } finally {
    for (const worker of workers) worker.terminate();
  }
  return phi;
}

function startWorker(): Worker {
  return moduleWorker(workerAddress);
}

function send(worker: Worker, message: ToWorker) {
  worker.postMessage(message);
}

function allocate(points: number, columns: number): Float32Array {
  const bytes = 4 * points * columns;
  try {
    if (bytes > MAX_PHI_BYTES) throw new RangeError();
    return new Float32Array(points * columns);
  } catch {
    const gigabytes = (bytes / 2 ** 30).toFixed(1);
    throw new Error(
      `The coordinates of ${points} points take ${gigabytes} GB, more than this browser gives a page; use a coarser model or cage.`,
    );
  }
}
