/** Frame records, `application/vnd.cager.frames`: one frame's rows with its number and errors. proto/README.md has the layout. */

import { crc32c } from '../container/crc32c';

export const RECORDS_MEDIA_TYPE = 'application/vnd.cager.frames';

const HEADER_BYTES = 28;
const MAGIC = 0x46524743; // "CGRF", little-endian
const VERSION = 1;
const CAGE = 3;

export interface CageRecord {
  readonly frame: number;
  /** Root mean square and largest error as fractions of the diagonal; NaN: not measured. */
  readonly l2: number;
  readonly linf: number;
  /** x y z of each row. */
  readonly rows: Float32Array;
}

/** Bytes that are no frame records of this session. Asking again gives other ones, if the transfer was at fault. */
export class BrokenRecord extends Error {
  override readonly name = 'BrokenRecord';
}

/** Takes a stream of cage records in pieces and gives the records that are whole. */
export class CageRecordReader {
  private readonly record: Uint8Array;
  private readonly view: DataView;
  private filled = 0;

  /** @param rows rows of every record of the session */
  constructor(private readonly rows: number) {
    this.record = new Uint8Array(HEADER_BYTES + 12 * rows);
    this.view = new DataView(this.record.buffer);
  }

  /** @throws BrokenRecord where the bytes are something else, or damaged */
  *push(piece: Uint8Array): Generator<CageRecord, void, undefined> {
    let at = 0;
    while (at < piece.length) {
      const taken = Math.min(this.record.length - this.filled, piece.length - at);
      this.record.set(piece.subarray(at, at + taken), this.filled);
      this.filled += taken;
      at += taken;
      if (this.filled < this.record.length) return;
      this.filled = 0;
      yield this.take();
    }
  }

  private take(): CageRecord {
    const view = this.view;
    const [magic, version, kind] = [view.getUint32(0, true), view.getUint16(4, true), view.getUint16(6, true)];
    if (magic !== MAGIC || version !== VERSION || kind !== CAGE || view.getUint32(12, true) !== this.rows)
      throw new BrokenRecord('The service sent unexpected data.');
    const payload = this.record.slice(HEADER_BYTES);
    if (crc32c(payload) !== view.getUint32(24, true)) throw new BrokenRecord('A frame was corrupted in transit.');
    // Platforms that run browsers are little-endian, as records are.
    const rows = new Float32Array(payload.buffer);
    return { frame: view.getUint32(8, true), l2: view.getFloat32(16, true), linf: view.getFloat32(20, true), rows };
  }
}
