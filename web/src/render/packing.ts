import type { StaticPart } from '../capture';
import { MAX_PHI_BYTES } from '../coordinates/compute';
import { diagonalOf } from '../coordinates/topology';

/** Binary logarithm of {@link WIDTH}. */
export const WIDTH_BITS = 10;
/**
 * Points per row of the textures that hold something for each point: point i is texel (i mod WIDTH, ⌊i / WIDTH⌋). A power of two: shaders need no
 * division, which software does for one vertex after another.
 */
export const WIDTH = 1 << WIDTH_BITS;
/** Φ is kept in 16 bits where that moves no point farther than this fraction of the rest pose's diagonal. */
const COMPACT_TOLERANCE = 1e-4;
/** Standard deviations of rounding that the estimate of its effect allows for. */
const DEVIATIONS = 4;
/** Entries between two pauses: some tens of milliseconds of work. */
const SLICE_ENTRIES = 1 << 20;
/** How much larger than at rest a cage may become in the estimate of what rounding does. */
const GROWTH = 1.5;

/**
 * Where Φ is in an array texture of four columns per texel: columns 4k … 4k+3 of point i are texel
 * `(i mod WIDTH, (band mod bandsPerLayer) · blocks + k, ⌊band / bandsPerLayer⌋)` with `band = ⌊i / WIDTH⌋`.
 */
export interface PhiLayout {
  /** Texels that hold the columns of one point. */
  readonly blocks: number;
  readonly bands: number;
  readonly bandsPerLayer: number;
  readonly height: number;
  readonly layers: number;
}

export interface TextureLimits {
  readonly size: number;
  readonly layers: number;
}

/** Arranges Φ within the limits. Throws where it does not fit. */
export function layoutOf(points: number, columns: number, limits: TextureLimits): PhiLayout {
  const blocks = Math.ceil(columns / 4);
  const bands = Math.max(1, Math.ceil(points / WIDTH));
  const mostBands = Math.min(bands, Math.floor(limits.size / Math.max(1, blocks)));
  const layers = Math.ceil(bands / mostBands);
  // All layers have the same height: spread evenly, bands leave the last one least empty.
  const bandsPerLayer = Math.ceil(bands / layers);
  // Texels of full floats, which are four columns each; 16 bits may turn out not to be accurate enough.
  const bytes = 16 * WIDTH * bandsPerLayer * blocks * layers;
  const fits = mostBands >= 1 && layers <= limits.layers && bands <= limits.size && limits.size >= WIDTH;
  if (!fits || bytes > MAX_PHI_BYTES) {
    throw new Error(
      `${points} points × ${columns} columns do not fit this device's graphics memory; open the capture on another device, or encode it with a coarser cage.`,
    );
  }
  return { blocks, bands, bandsPerLayer, height: bandsPerLayer * blocks, layers };
}

export interface PackedPhi {
  /** Full floats; or integers t of which `scale · t·|t| / 32767²` are the entries: finer near zero, where most of them are. */
  readonly texels: Int16Array | Float32Array;
  readonly scale: number;
  /** How far rounding moves a point at the most, in fractions of the diagonal: an estimate for cages up to 1.5 times as large as at rest. */
  readonly error: number;
}

/**
 * Packs Φ, points × columns, for the layout: in 16 bits where these are accurate enough. `size` is what {@link cageSize} says. The page stays
 * responsive meanwhile.
 */
export async function packPhi(phi: Float32Array, columns: number, size: number, layout: PhiLayout): Promise<PackedPhi> {
  const points = phi.length / columns;
  let scale = 0;
  await inSlices(points, columns, (i) => {
    for (let k = i * columns; k < (i + 1) * columns; k++) scale = Math.max(scale, Math.abs(phi[k]));
  });
  const length = 4 * WIDTH * layout.height * layout.layers;
  const compact = new Int16Array(length);
  let worst = 0;
  await inSlices(points, columns, (i) => {
    const texel = firstTexel(i, layout);
    let squares = 0;
    for (let column = 0; column < columns; column++) {
      const value = phi[i * columns + column];
      const integer = compacted(value, scale);
      compact[texel + offsetOf(column)] = integer;
      squares += (expanded(integer, scale) - value) ** 2;
    }
    worst = Math.max(worst, squares);
  });
  const error = DEVIATIONS * Math.sqrt(worst) * size;
  if (error <= COMPACT_TOLERANCE) return { texels: compact, scale, error };
  const floats = new Float32Array(length);
  await inSlices(points, columns, (i) => {
    const texel = firstTexel(i, layout);
    for (let column = 0; column < columns; column++) floats[texel + offsetOf(column)] = phi[i * columns + column];
  });
  return { texels: floats, scale: 1, error: 0 };
}

/** Calls `work` for every point, and lets the page do something else every few hundred thousand entries. */
async function inSlices(points: number, columns: number, work: (point: number) => void) {
  const slice = Math.ceil(SLICE_ENTRIES / columns);
  for (let first = 0; first < points; first += slice) {
    const end = Math.min(points, first + slice);
    for (let i = first; i < end; i++) work(i);
    if (end < points) await new Promise<void>((resolve) => setTimeout(resolve));
  }
}

/** The integer for an entry, −32767 … 32767. */
export function compacted(value: number, scale: number): number {
  if (scale === 0) return 0;
  return Math.sign(value) * Math.round(32767 * Math.sqrt(Math.min(1, Math.abs(value) / scale)));
}

export function expanded(integer: number, scale: number): number {
  return scale * (integer / 32767) * Math.abs(integer / 32767);
}

/** Index of the first number of a point's first texel. */
function firstTexel(point: number, { bandsPerLayer, height, blocks }: PhiLayout): number {
  const band = Math.floor(point / WIDTH);
  const layer = Math.floor(band / bandsPerLayer);
  const y = layer * height + (band - layer * bandsPerLayer) * blocks;
  return 4 * (y * WIDTH + (point % WIDTH));
}

/** How far behind a point's first number that of a column is. */
function offsetOf(column: number): number {
  return 4 * WIDTH * (column >> 2) + (column & 3);
}

/** How far a vertex of the cage can be from the mean of all, which is subtracted before Φ multiplies, in fractions of the rest pose's diagonal. */
export function cageSize(capture: Pick<StaticPart, 'cage' | 'rest'>): number {
  const { positions } = capture.cage;
  const vertices = positions.length / 3;
  const mean = meanOf(positions, vertices);
  let squares = 0;
  for (let k = 0; k < positions.length; k++) squares += (positions[k] - mean[k % 3]) ** 2;
  // Rounding has no preferred direction: what counts is the root mean square.
  return (GROWTH * Math.sqrt(squares / Math.max(1, vertices))) / (diagonalOf(capture.rest) || 1);
}

export function meanOf(positions: ArrayLike<number>, count: number): [number, number, number] {
  const sum: [number, number, number] = [0, 0, 0];
  for (let k = 0; k < 3 * count; k++) sum[k % 3] += positions[k];
  return [sum[0] / count, sum[1] / count, sum[2] / count];
}
