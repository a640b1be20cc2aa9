/** Blocks of frames from their sections. */

import type { FrameBlock, Residual, StaticPart } from '../capture';
import { sampleStride } from '../codec/basis';
import { MAX_ROWS } from '../codec/cages';
import type { Codec } from '../codec/client';
import { columnsOf } from '../coordinates/compute';
import { TiedNormals } from '../coordinates/tiedNormals';
import { decodePayload } from './codecs';
import { damaged, isDamage } from './error';
import { mostResidualNumbers } from './layout';
import { located, type Section } from './meshes';
import { CODEC } from './section';

/**
 * Rows of Φ of some points of the model, x y z each, with these indices: points × columns in double precision, or in single where that is all there is: cages
 * then differ by some 1e-6 of their size. Columns beyond the stored rows may be there or not.
 */
export type CoordinatesOf = (part: StaticPart, points: Float64Array, indices: Uint32Array) => Promise<Float64Array>;

/** Numbers of Φ that are computed between one message to the codec and the next. */
const BATCH_NUMBERS = 1 << 19;

/** A block, and what is wrong with its residual where that cannot be decoded. */
export interface DecodedBlock {
  readonly block: FrameBlock;
  readonly problem: Error | null;
}

/** Decodes the blocks of one capture. */
export class BlockDecoder {
  private basis: Promise<void> | null = null;
  private hasModel = false;

  /** @param coordinates where the basis of coded cages comes from; null for the codec's own computation. */
  constructor(
    private readonly part: StaticPart,
    private readonly codec: Codec,
    private readonly coordinates: CoordinatesOf | null,
  ) {}

  /**
   * @param residual the section before the frames.
   * @param fileBytes length of the file, which limits what a residual may take.
   */
  async decode(
    frames: Section,
    residual: Section | null,
    fileBytes: number,
    signal?: AbortSignal,
  ): Promise<DecodedBlock> {
    const { first, count } = frames.entry.fields;
    const cages = await this.cages(frames, signal);
    const bad = cages.findIndex((x) => !Number.isFinite(x));
    if (bad >= 0) {
      const frame = first + Math.floor(bad / (3 * this.part.rowsPerFrame));
      throw damaged(frames.entry.offset, `the cage of frame ${frame} is not finite`);
    }
    let added: Residual | null = null;
    let problem: Error | null = null;
    if (residual !== null) {
      try {
        added = await this.residual(residual, fileBytes, signal);
      } catch (error) {
        if (!isDamage(error)) {
          throw error;
        }
        problem = error;
      }
    }
    return { block: { first, count, cages, residual: added }, problem };
  }

  private async cages({ entry, payload }: Section, signal: AbortSignal | undefined): Promise<Float32Array> {
    const { codec, count } = entry.fields;
    if (codec !== CODEC.coded) {
      return new Float32Array(decodePayload(entry, payload, 3 * this.part.rowsPerFrame).buffer);
    }
    if (this.part.rowsPerFrame > MAX_ROWS) {
      throw damaged(entry.offset, `a coded frame has ${this.part.rowsPerFrame} rows`);
    }
    this.basis ??= this.addCoordinates().catch((error: unknown) => {
      this.basis = null;
      throw error;
    });
    await this.basis;
    return located(entry, this.codec.call('cages', [payload, count, restRows(this.part)], signal));
  }

  private async residual(
    { entry, payload }: Section,
    fileBytes: number,
    signal: AbortSignal | undefined,
  ): Promise<Residual> {
    if (!this.hasModel) {
      this.hasModel = true;
      const { cornerCounts, corners, rest } = this.part;
      await this.codec.call('setModel', [{ counts: cornerCounts, corners }, rest.length / 3]);
    }
    const most = mostResidualNumbers(fileBytes);
    return located(entry, this.codec.call('residual', [payload, entry.fields.count, most], signal));
  }

  /** Hands the coordinates of the sampled points to the codec, some at a time. */
  private async addCoordinates(): Promise<void> {
    const { part, codec, coordinates } = this;
    const stride = sampleStride(part.rest.length / 3);
    const sampled = Math.ceil(part.rest.length / 3 / stride);
    const batch = Math.max(1, Math.floor(BATCH_NUMBERS / columnsOf(part.system, part.cage)));
    for (let start = 0; start === 0 || start < sampled; start += batch) {
      const count = Math.min(batch, sampled - start);
      const indices = Uint32Array.from({ length: count }, (_, k) => (start + k) * stride);
      const points = Float64Array.from({ length: 3 * count }, (_, at) => {
        return part.rest[3 * indices[Math.floor(at / 3)] + (at % 3)];
      });
      if (coordinates === null) {
        await codec.call('computeBasis', [part.system, part.cage, points, part.rowsPerFrame, start === 0]);
      } else {
        const rows = await coordinates(part, points, indices);
        const columns = count > 0 ? rows.length / count : part.rowsPerFrame;
        if (columns < part.rowsPerFrame || !Number.isInteger(columns)) {
          throw new Error(`The coordinates have ${columns} columns, not ${part.rowsPerFrame}. Reload the page.`);
        }
        await codec.call('addCoordinates', [rows, columns, part.rowsPerFrame, start === 0]);
      }
    }
  }
}

/** Rows of the rest pose: the cage's vertices, and where normals are stored those of its faces. */
function restRows({ system, cage, rowsPerFrame }: StaticPart): Float64Array {
  const rows = new Float64Array(3 * rowsPerFrame);
  rows.set(cage.positions);
  if (system === 'green-free') {
    new TiedNormals(cage).write(cage.positions, rows, cage.positions.length);
  }
  return rows;
}
