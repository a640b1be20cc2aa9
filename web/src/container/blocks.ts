/** Blocks of frames from their sections. */

import type { FrameBlock, Residual, StaticPart } from '../capture';
import { sampleStride } from '../codec/basis';
import { MAX_ROWS } from '../codec/cages';
import type { Codec } from '../codec/client';
import { columnsOf } from '../coordinates/compute';
import { computePhi } from '../coordinates/pool';
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

export class BlockDecoder {
  private basis: Promise<void> | null = null;
  /** Whether that basis is rounded, so that it is of coordinates in closed form. */
  private basisIsRounded = true;
  /** Φ of all points, where the basis is of all of them, until it is handed on. */
  private computed: Promise<Float32Array> | null = null;
  private onProgress: ((fraction: number) => void) | undefined;
  private hasModel = false;

  /** @param given where the basis of coded cages comes from; null where it is to be computed. */
  constructor(
    private readonly part: StaticPart,
    private readonly codec: Codec,
    private readonly given: CoordinatesOf | null,
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
    // The codec decodes the residual while others compute the coordinates that cages need.
    const adding = residual === null ? null : this.residual(residual, fileBytes, signal);
    adding?.catch(() => undefined);
    const cages = await this.cages(frames, signal);
    const bad = cages.findIndex((x) => !Number.isFinite(x));
    if (bad >= 0) {
      const frame = first + Math.floor(bad / (3 * this.part.rowsPerFrame));
      throw damaged(frames.entry.offset, `the cage of frame ${frame} is not finite`);
    }
    let added: Residual | null = null;
    let problem: Error | null = null;
    try {
      added = await adding;
    } catch (error) {
      if (!isDamage(error)) throw error;
      problem = error;
    }
    return { block: { first, count, cages, residual: added }, problem };
  }

  /**
   * Φ, points × columns, in single precision: what the basis of the coded cages is computed of, the first time and where it is of all points, or else computed anew.
   */
  async phi(onProgress: (fraction: number) => void, signal: AbortSignal): Promise<Float32Array> {
    const { part } = this;
    if (this.basis === null && this.given === null && part.rowsPerFrame <= MAX_ROWS)
      this.prepareBasis().catch(() => undefined);
    const { computed } = this;
    if (computed === null) return computePhi(part, { onProgress, signal });
    this.computed = null;
    this.onProgress = onProgress;
    return computed.finally(() => signal.throwIfAborted());
  }

  private async cages({ entry, payload }: Section, signal: AbortSignal | undefined): Promise<Float32Array> {
    const { codec, count } = entry.fields;
    if (codec !== CODEC.coded)
      return new Float32Array(decodePayload(entry, payload, 3 * this.part.rowsPerFrame).buffer);
    if (this.part.rowsPerFrame > MAX_ROWS)
      throw damaged(entry.offset, `a coded frame has ${this.part.rowsPerFrame} rows`);
    const isRounded = payload.length === 0 || payload[0] >= 2;
    if (this.basis === null || (this.part.system === 'harmonic' && this.basisIsRounded !== isRounded))
      this.basis = this.prepareBasis(isRounded);
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

  private prepareBasis(isRounded = true): Promise<void> {
    const { given } = this;
    this.basisIsRounded = isRounded;
    this.basis = given === null || isRounded ? this.computeBasis(isRounded) : this.addGiven(given);
    return this.basis.catch((error: unknown) => {
      this.basis = null;
      this.computed = null;
      throw error;
    });
  }

  /** Computes the coordinates of the sampled points, and hands them to the codec as they come. */
  private async computeBasis(isRounded: boolean): Promise<void> {
    const { part, codec } = this;
    const { cage, rowsPerFrame } = part;
    const system = isRounded && part.system === 'harmonic' ? 'mvc' : part.system;
    const rest = pointsAt(part.rest, sampledPoints(part));
    let isFirst = true;
    const onRows = async (rows: Float64Array): Promise<void> => {
      const start = isFirst;
      isFirst = false;
      await codec.call('addCoordinates', [rows, columnsOf(system, cage), rowsPerFrame, start]);
    };
    const phi = computePhi({ system, cage, rest }, { onRows, onProgress: (fraction) => this.onProgress?.(fraction) });
    this.computed = system === part.system && rest.length === part.rest.length ? phi : null;
    await phi;
  }

  /** Hands the given coordinates of the sampled points to the codec, some at a time. */
  private async addGiven(given: CoordinatesOf): Promise<void> {
    const { part, codec } = this;
    const sampled = sampledPoints(part);
    const batch = Math.max(1, Math.floor(BATCH_NUMBERS / columnsOf(part.system, part.cage)));
    for (let start = 0; start === 0 || start < sampled.length; start += batch) {
      const indices = sampled.slice(start, start + batch);
      const rows = await given(part, pointsAt(part.rest, indices), indices);
      const columns = indices.length > 0 ? rows.length / indices.length : part.rowsPerFrame;
      if (columns < part.rowsPerFrame || !Number.isInteger(columns))
        throw new Error(`The coordinates have ${columns} columns, not ${part.rowsPerFrame}. Reload the page.`);
      await codec.call('addCoordinates', [rows, columns, part.rowsPerFrame, start === 0]);
    }
  }
}

/** Indices of the points whose coordinates make the basis. */
function sampledPoints({ rest }: StaticPart): Uint32Array {
  const stride = sampleStride(rest.length / 3);
  return Uint32Array.from({ length: Math.ceil(rest.length / 3 / stride) }, (_, k) => k * stride);
}

function pointsAt(positions: Float64Array, indices: Uint32Array): Float64Array {
  const points = new Float64Array(3 * indices.length);
  indices.forEach((index, k) => points.set(positions.subarray(3 * index, 3 * index + 3), 3 * k));
  return points;
}

/** Rows of the rest pose: the cage's vertices, and where normals are stored those of its faces. */
function restRows({ system, cage, rowsPerFrame }: StaticPart): Float64Array {
  const rows = new Float64Array(3 * rowsPerFrame);
  rows.set(cage.positions);
  if (system === 'green-free') new TiedNormals(cage).write(cage.positions, rows, cage.positions.length);
  return rows;
}
