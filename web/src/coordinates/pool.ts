import type { StaticPart } from '../capture';
import { columnsOf, computeCoordinates, MAX_PHI_BYTES } from './compute';
import type { FromWorker, ToWorker } from './messages';
import { moduleWorker } from '../moduleWorker';
import workerAddress from './worker.ts?worker&url';

/** Entries of Φ that a worker computes before it reports: some tens of milliseconds of work. */
const SLICE_ENTRIES = 1 << 17;
/** More workers hardly help: the rows have to be copied into one array. */
const MAX_WORKERS = 8;

/** Milliseconds between reports: drawing each of them would take the processor from the computation. */
const REPORT_EVERY = 200;

export interface ComputeOptions {
  readonly signal?: AbortSignal;
  /** Called with the fraction of the rows that are there. */
  readonly onProgress?: (fraction: number) => void;
  /** Takes the rows before they are rounded, some at a time and in order; where it fails, so does the computation. */
  readonly onRows?: (rows: Float64Array) => Promise<void>;
}

/**
 * Computes Φ in web workers, where there are any, in double precision, rounded to single at the end: points × columns, row-major.
 *
 * Rejects with the signal's reason when aborted, and with one sentence for a person where Φ does not fit into memory or does not exist.
 */
export async function computePhi(
  capture: Pick<StaticPart, 'system' | 'cage' | 'rest'>,
  options: ComputeOptions = {},
): Promise<Float32Array> {
  const { signal, onProgress, onRows } = options;
  signal?.throwIfAborted();
  const { system, cage, rest } = capture;
  const points = rest.length / 3;
  const columns = columnsOf(system, cage);
  const phi = allocate(points, columns);
  if (points === 0) {
    await onRows?.(new Float64Array(0));
    return phi;
  }
  const slice = Math.max(1, Math.floor(SLICE_ENTRIES / columns));
  const slices = Math.ceil(points / slice);
  const pointsOf = (index: number) => rest.slice(3 * index * slice, 3 * (index + 1) * slice);
  if (typeof Worker === 'undefined') {
    for (let k = 0; k < slices; k++) {
      const rows = computeCoordinates(system, cage, pointsOf(k), k * slice);
      phi.set(rows, k * slice * columns);
      await onRows?.(rows);
    }
    return phi;
  }
  const count = Math.min(MAX_WORKERS, slices, Math.max(1, navigator.hardwareConcurrency));
  let failed: (error: Error) => void = () => undefined;
  const workers = Array.from({ length: count }, () => moduleWorker(workerAddress, (error) => failed(error)));
  try {
    await new Promise<void>((resolve, reject) => {
      failed = reject;
      let [sent, done, reported] = [0, 0, performance.now()];
      const sendNext = (worker: Worker) => {
        if (sent >= slices) return;
        send(worker, { kind: 'points', slice: sent, first: sent * slice, points: pointsOf(sent) });
        sent++;
      };
      /** Rows that came before those in front of them. */
      const early = new Map<number, Float64Array>();
      let taken = 0;
      let taking = Promise.resolve();
      const take = (index: number, rows: Float64Array) => {
        early.set(index, rows);
        for (let next = early.get(taken); next !== undefined; next = early.get(++taken)) {
          early.delete(taken);
          taking = onRows!(next);
          taking.catch(reject);
        }
      };
      signal?.addEventListener('abort', () => reject(signal.reason as Error), { once: true });
      for (const worker of workers) {
        worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
          if (data.kind === 'failed') {
            reject(new Error(data.problem));
            return;
          }
          phi.set(data.rows, data.slice * slice * columns);
          if (data.rows instanceof Float64Array) take(data.slice, data.rows);
          done++;
          if (performance.now() - reported >= REPORT_EVERY) {
            reported = performance.now();
            onProgress?.(done / slices);
          }
          if (done === slices) taking.then(resolve, reject);
          else sendNext(worker);
        };
        send(worker, { kind: 'cage', system, cage, isExact: onRows !== undefined });
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
