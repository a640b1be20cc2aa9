import { columnsOf, rowsOf } from './compute';
import type { RowOf } from './meanValue';
import type { FromWorker, ToWorker } from './messages';

let fill: RowOf | null = null;
let row = new Float64Array(0);

self.addEventListener('message', ({ data }: MessageEvent<ToWorker>) => {
  try {
    if (data.kind === 'cage') {
      const cage = { positions: data.positions, triangles: data.triangles };
      fill = rowsOf(data.system, cage);
      row = new Float64Array(columnsOf(data.system, cage));
    } else if (fill) {
      const rows = computeRows(fill, data.points);
      answer({ kind: 'rows', first: data.first, rows }, [rows.buffer]);
    }
  } catch (error) {
    answer({ kind: 'failed', problem: error instanceof Error ? error.message : String(error) }, []);
  }
});

function computeRows(fillRow: RowOf, points: Float64Array): Float32Array<ArrayBuffer> {
  const count = points.length / 3;
  const rows = new Float32Array(count * row.length);
  for (let i = 0; i < count; i++) {
    fillRow(points[3 * i], points[3 * i + 1], points[3 * i + 2], row, 0);
    rows.set(row, i * row.length);
  }
  return rows;
}

function answer(message: FromWorker, transfer: Transferable[]) {
  self.postMessage(message, { transfer });
}
