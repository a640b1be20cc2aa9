/** What lies on the faces of a model, as far as it is drawn: the first texture coordinates, materials and hard edges; docs/FORMAT.md, "surf". */

import { CodedDataError } from '../error';
import type { Polygons } from '../polygons';
import { decodePositions } from '../positions';
import { decodeFaceOrder } from './faceOrder';
import { decodeLabels } from './labels';
import { decodeSharing } from './sharing';
import { decodeTilts } from './tilts';

/** Most streams of all parts together. */
const MAX_STREAMS = 1 << 16;
/** Numbers that are decoded at the most for each face and corner, and for each byte. */
const [NUMBERS_OF_CORNERS, NUMBERS_OF_BYTES] = [64, 16];

/** How large a part is, and how many streams it has. */
export interface PartSize {
  readonly points: number;
  readonly faces: number;
  readonly uvSets: number;
  readonly colorSets: number;
  readonly groups: number;
  /** Whether normals lean away from those of the faces around. */
  readonly isTilted: boolean;
}

/** What a part has by corner and by face. Corners are those of its faces, one after another. */
export interface PartSurface {
  /** Its faces, which name points of the model. */
  readonly faces: Polygons;
  /** Texture coordinates, u and v each, and which of them each corner has. Null where the part has none. */
  readonly uvs: { readonly values: Float32Array; readonly numbers: Uint32Array } | null;
  /** Corners of a point that have the same number share a normal; null where all do. */
  readonly normals: Uint32Array | null;
  /** By these numbers two angles each, by which the normal leans away; null where none does. */
  readonly tilts: Float32Array | null;
  /** 0 for none, else one more than the place of the face's material; null where no face has one. */
  readonly materials: Uint32Array | null;
}

/** @param bytes what follows the names: the order of the faces, then the streams of all parts */
export function decodeSurface(
  bytes: Uint8Array,
  parts: readonly PartSize[],
  materials: number,
  coded: Polygons,
  points: number,
): PartSurface[] {
  const sum = (of: (part: PartSize) => number) => parts.reduce((all, part) => all + of(part), 0);
  if (sum((part) => part.points) !== points || sum((part) => part.faces) !== coded.counts.length)
    throw new CodedDataError('parts are not those of the mesh');
  const streams = new Streams(bytes);
  const faces = decodeFaceOrder(streams.take(), coded, points);
  streams.allow(NUMBERS_OF_CORNERS * (coded.counts.length + coded.corners.length));
  const next = { point: 0, face: 0, corner: 0 };
  const found = parts.map((part) => {
    const counts = faces.counts.subarray(next.face, next.face + part.faces);
    const end = next.corner + counts.reduce((all, count) => all + count, 0);
    const own = { counts, corners: faces.corners.subarray(next.corner, end) };
    const surface = decodePart(streams, part, own, next.point, materials);
    next.point += part.points;
    next.face += part.faces;
    next.corner = end;
    return surface;
  });
  streams.end();
  return found;
}

function decodePart(
  streams: Streams,
  part: PartSize,
  faces: Polygons,
  firstPoint: number,
  materialCount: number,
): PartSurface {
  const corners = faces.corners.length;
  const local = { counts: faces.counts, corners: faces.corners.map((point) => point - firstPoint) };
  if (local.corners.some((point) => point >= part.points)) throw new CodedDataError('a face has corners in two parts');
  let uvs: PartSurface['uvs'] = null;
  for (let set = 0; set < part.uvSets; set++) {
    const stream = streams.next(5 * corners);
    // Others than the first are not drawn.
    if (set === 0) uvs = decodeUvs(stream, local, part.points);
  }
  for (let set = 0; set < part.colorSets; set++) streams.next(7 * corners);
  const sharing = streams.next(corners);
  const tilted = part.isTilted ? streams.next(2 * corners) : null;
  const labels = streams.next(part.faces);
  for (let group = 0; group < part.groups; group++) streams.next(part.faces);
  const materials = labels.length === 0 ? null : decodeLabels(labels, local, part.points);
  if (materials?.some((label) => label > materialCount) === true)
    throw new CodedDataError('a face has a material that is not there');
  const normals = sharing.length === 0 ? null : decodeSharing(sharing, local, part.points);
  if (tilted !== null && normals === null) throw new CodedDataError('normals are tilted that are not there');
  const tilts = tilted && normals && decodeTilts(tilted, local, normals);
  return { faces, uvs, normals: normals?.numbers ?? null, tilts, materials };
}

function decodeUvs(bytes: Uint8Array, faces: Polygons, points: number): PartSurface['uvs'] {
  const streams = new Streams(bytes);
  const { numbers, count } = decodeSharing(streams.take(), faces, points);
  const values = new Float32Array(2 * count);
  if (count === 0) return { values, numbers };
  // The values are those of a mesh of its own, torn at the seams.
  const positions = decodePositions(streams.take(), { counts: faces.counts, corners: numbers }, count);
  for (let k = 0; k < count; k++) {
    values[2 * k] = positions[3 * k];
    values[2 * k + 1] = positions[3 * k + 1];
  }
  if (!values.every(Number.isFinite)) throw new CodedDataError('a value at a corner is not finite');
  return { values, numbers };
}

/** Streams one after another, each behind its length. */
class Streams {
  private at = 0;
  private numbersLeft = 0;
  private streamsLeft = MAX_STREAMS;

  constructor(private readonly bytes: Uint8Array) {}

  /** Sets how many numbers {@link next} may give, beside those for the bytes that are left. */
  allow(numbers: number): void {
    this.numbersLeft = numbers + NUMBERS_OF_BYTES * (this.bytes.length - this.at);
  }

  /** The next one, which decodes to so many numbers at the most. */
  next(numbers: number): Uint8Array {
    this.streamsLeft--;
    this.numbersLeft -= numbers;
    if (this.streamsLeft < 0 || this.numbersLeft < 0)
      throw new CodedDataError('more lies on the faces than a file of this size holds');
    return this.take();
  }

  take(): Uint8Array {
    const { bytes, at } = this;
    const start = at + 4;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    const end = start <= bytes.length ? start + view.getUint32(at, true) : Infinity;
    if (end > bytes.length) throw new CodedDataError('what lies on the faces is cut');
    this.at = end;
    return bytes.subarray(start, end);
  }

  end(): void {
    if (this.at !== this.bytes.length) throw new CodedDataError('more lies on the faces than is named');
  }
}
