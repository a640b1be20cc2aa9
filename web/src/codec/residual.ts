/** What is added to the positions of a group's cages; docs/FORMAT.md, "Residual". `crates/codec/src/residual.rs` is the reference. */

import type { Residual } from '../capture';
import { MAX_FRAMES } from './cages';
import { CodedDataError } from './error';
import type { Hierarchy } from './hierarchy';
import { IntegerModels, MAX_RESIDUAL_SIZE, SIZE_CLASSES, sizeClass } from './integers';
import { BinaryModels, RangeDecoder } from './rangeDecoder';
import { decodeTrajectories } from './trajectories';

/** Most positions of a group, points times frames. */
const MAX_POSITIONS = 2 ** 26;
/** Step (f64), number of components (u16), step of corrections (f64), and bytes of the components (u32). */
const HEAD_BYTES = 22;
/** Added to the number of components where the vertices are in two parts; the bytes of the second one (u32) then follow the head. */
const PARTED = 1 << 15;
/** Parts of a step in which predictions are counted. */
const PARTS = 16;

/**
 * Decodes the residual of a group of so many frames.
 *
 * @param mostNumbers most numbers of its components, three for each point.
 */
export function decodeResidual(bytes: Uint8Array, hierarchy: Hierarchy, frames: number, mostNumbers: number): Residual {
  const points = hierarchy.order.length;
  if (frames > MAX_FRAMES || points * frames > MAX_POSITIONS)
    throw new CodedDataError('a group has too many positions');
  const isHead = (parted: boolean) => bytes.length >= HEAD_BYTES + (parted ? 4 : 0);
  if (!isHead(false) || !isHead((bytes[9] & 0x80) !== 0)) throw new CodedDataError('a residual is cut');
  const head = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const step = head.getFloat64(0, true);
  const parted = (head.getUint16(8, true) & PARTED) !== 0;
  const rank = head.getUint16(8, true) % PARTED;
  const correctionStep = head.getFloat64(10, true);
  const first = HEAD_BYTES + (parted ? 4 : 0);
  const second = first + head.getUint32(18, true);
  const end = second + (parted ? head.getUint32(HEAD_BYTES, true) : 0);
  const tooMany = rank > Math.min(frames, 3 * points) || 3 * points * rank > mostNumbers || end > bytes.length;
  if (tooMany || !Number.isFinite(step) || !Number.isFinite(correctionStep))
    throw new CodedDataError('a residual has impossible counts');
  const decoder = new RangeDecoder(bytes.subarray(first, second));
  const trajectories = Float32Array.from(decodeTrajectories(decoder, frames, rank));
  const shapes = new Float32Array(rank * 3 * points);
  const components = new Components(decoder, parted ? new RangeDecoder(bytes.subarray(second, end)) : null, hierarchy);
  const unit = step / PARTS;
  for (let k = 0; k < rank; k++) {
    const parts = components.next();
    for (let at = 0, out = k * 3 * points; at < parts.length; at++, out++) shapes[out] = parts[at] * unit;
  }
  return { rank, trajectories, shapes, ...decodeCorrections(bytes.subarray(end), frames, points, correctionStep) };
}

/** Some of the vertices, coded by models of their own. */
class Part {
  private readonly predicted = new IntegerModels(3 * SIZE_CLASSES);
  private readonly plain = new IntegerModels(3 * SIZE_CLASSES);

  /** From the place `start` in the order of the hierarchy to before `end`. */
  constructor(
    private readonly decoder: RangeDecoder,
    private readonly hierarchy: Hierarchy,
    private readonly start: number,
    private readonly end: number,
  ) {}

  /** Reads the part's numbers of a component. `before` and `sizes` are sizes of the numbers of the component before, and of this one. */
  read(predicts: boolean, found: Float64Array, before: Uint32Array, sizes: Uint32Array): void {
    const { order, starts, parents } = this.hierarchy;
    const models = predicts ? this.predicted : this.plain;
    for (let place = this.start; place < this.end; place++) {
      const start = starts[place];
      const end = starts[place + 1];
      const count = end - start;
      let beside = 0;
      for (let axis = 0; axis < 3; axis++) {
        const at = 3 * order[place] + axis;
        let around = 0;
        let sum = 0;
        for (let k = start; k < end; k++) {
          const parent = 3 * parents[k] + axis;
          around += sizes[parent];
          sum += found[parent];
        }
        let expected = 0;
        if (count > 0) {
          around = Math.floor((16 * around) / count);
          expected = predicts ? Math.floor(sum / count) : 0;
        }
        const context = SIZE_CLASSES * axis + sizeClass(around + 6 * before[at] + beside);
        const value = models.signed(this.decoder, context);
        found[at] = expected + PARTS * value;
        const size = Math.min(Math.abs(value), MAX_RESIDUAL_SIZE);
        sizes[at] = size;
        beside = (beside >> 1) + 5 * size;
      }
    }
  }
}

/** Reads component after component, of all vertices at once or of a first and a second half by two decoders. */
class Components {
  private readonly kind = new BinaryModels(1);
  private readonly parts: Part[];
  private readonly found: Float64Array;
  /** Sizes of the numbers of the component before, and of this one. */
  private before: Uint32Array;
  private sizes: Uint32Array;

  constructor(
    private readonly decoder: RangeDecoder,
    second: RangeDecoder | null,
    hierarchy: Hierarchy,
  ) {
    const points = hierarchy.order.length;
    const middle = second === null ? points : Math.floor(points / 2);
    this.parts = [new Part(decoder, hierarchy, 0, middle), new Part(second ?? decoder, hierarchy, middle, points)];
    this.found = new Float64Array(3 * points);
    this.before = new Uint32Array(3 * points);
    this.sizes = new Uint32Array(3 * points);
  }

  /** Values of the next component in parts of a step, x y z of each point. */
  next(): Float64Array {
    const { found, before, sizes } = this;
    const predicts = this.decoder.bit(this.kind, 0) === 1;
    for (const part of this.parts) part.read(predicts, found, before, sizes);
    this.before = sizes;
    this.sizes = before;
    return found;
  }
}

/** Adds what a residual says of one of its group's frames to positions, x y z of each point, in single precision. */
export function addResidual(residual: Residual, frame: number, positions: Float32Array): void {
  const { rank, trajectories, shapes, correctionStarts, correctedPoints, correctionVectors } = residual;
  const sums = new Float64Array(positions.length);
  for (let k = 0; k < rank; k++) {
    const factor = trajectories[frame * rank + k];
    if (factor === 0) continue;
    for (let at = 0, from = k * positions.length; at < positions.length; at++, from++) {
      sums[at] += factor * shapes[from];
    }
  }
  for (let at = 0; at < positions.length; at++) positions[at] += sums[at];
  for (let k = correctionStarts[frame]; k < correctionStarts[frame + 1]; k++) {
    for (let axis = 0; axis < 3; axis++) positions[3 * correctedPoints[k] + axis] += correctionVectors[3 * k + axis];
  }
}

/** The corrections of a group of frames, as in `Residual` of `capture.ts`. */
export interface Corrections {
  readonly correctionStarts: Uint32Array;
  readonly correctedPoints: Uint32Array;
  readonly correctionVectors: Float32Array;
}

/**
 * Decodes the corrections of a group, none of no bytes.
 *
 * @param step unit of the corrections.
 */
export function decodeCorrections(bytes: Uint8Array, frames: number, points: number, step: number): Corrections {
  const correctionStarts = new Uint32Array(frames + 1);
  const vertices: number[] = [];
  const vectors: number[] = [];
  if (bytes.length > 0) {
    const decoder = new RangeDecoder(bytes);
    const counts = new IntegerModels(1);
    const gaps = new IntegerModels(1);
    const steps = new IntegerModels(3);
    // Numbers of high probability take next to no bytes.
    let left = (1 << 20) + 64 * bytes.length;
    let count = 0;
    for (let frame = 0; frame < frames; frame++) {
      count = Math.max(0, count + counts.signed(decoder, 0));
      left -= count;
      if (left < 0 || count > points) throw new CodedDataError('there are more corrections than there can be');
      let next = 0;
      for (let k = 0; k < count; k++) {
        const vertex = next + gaps.natural(decoder, 0);
        if (vertex >= points) throw new CodedDataError('a correction is of no point');
        vertices.push(vertex);
        for (let axis = 0; axis < 3; axis++) vectors.push(steps.signed(decoder, axis) * step);
        next = vertex + 1;
      }
      correctionStarts[frame + 1] = vertices.length;
    }
  }
  return {
    correctionStarts,
    correctedPoints: Uint32Array.from(vertices),
    correctionVectors: Float32Array.from(vectors),
  };
}
