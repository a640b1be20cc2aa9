import '../workerStarted';
import { columnsOf, rowsOf, type RowOfPoint } from './compute';
import { sentence } from '../text';
import type { FromWorker, ToWorker } from './messages';

let fill: RowOfPoint | null = null;
let row = new Float64Array(0);
let isExact = false;

self.addEventListener('message', ({ data }: MessageEvent<ToWorker>) => {
  try {
    if (data.kind === 'cage') {
      fill = rowsOf(data.system, data.cage);
      row = new Float64Array(columnsOf(data.system, data.cage));
      isExact = data.isExact;
    } else if (fill) {
      const rows = computeRows(fill, data.first, data.points);
      answer({ kind: 'rows', slice: data.slice, rows }, [rows.buffer]);
    }
  } catch (error) {
    answer({ kind: 'failed', problem: sentence(error) }, []);
  }
});

function computeRows(
  fillRow: RowOfPoint,
  first: number,
  points: Float64Array,
): Float32Array<ArrayBuffer> | Float64Array<ArrayBuffer> {
  const count = points.length / 3;
  const rows = new (isExact ? Float64Array : Float32Array)(count * row.length);
  for (let i = 0; i < count; i++) {
    fillRow(first + i, points[3 * i], points[3 * i + 1], points[3 * i + 2], row, 0);
    rows.set(row, i * row.length);
  }
  return rows;
}

function answer(message: FromWorker, transfer: Transferable[]) {
  self.postMessage(message, { transfer });
}
