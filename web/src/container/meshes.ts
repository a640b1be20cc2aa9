/** Model and cage from their sections. */

import type { Carrier, StaticPart, TriangleMesh, UpAxis } from '../capture';
import type { Codec } from '../codec/client';
import { CodedDataError } from '../codec/error';
import { NO_POLYGONS, type Polygons } from '../codec/polygons';
import { decodePayload } from './codecs';
import { damaged } from './error';
import type { Head } from './head';
import { CODEC, type Entry } from './section';

/** Sections before the frames that model and cage are made of. */
export const STATIC_TAGS: readonly string[] = ['ORIG', 'RPTS', 'RFAC', 'COMP', 'CVTX', 'CTRI', 'ELEM'];

/** Sections of model and cage without which they can be shown: where one is damaged, it is left out. */
export const OPTIONAL_TAGS: readonly string[] = ['unit', 'rcol'];

/** Sections with what lies on the faces of the model, which is read once the model can be seen. */
export const SURFACE_TAGS: readonly string[] = ['surf', 'pict'];

const AXES: readonly (UpAxis | undefined)[] = [undefined, 'y', 'z'];

/** A section and its payload as it is in the file, whose checksum and sizes were checked. */
export interface Section {
  readonly entry: Entry;
  readonly payload: Uint8Array;
}

/** Decodes what does not change from frame to frame. */
export async function decodeStatic(
  head: Head,
  sections: ReadonlyMap<string, Section>,
  codec: Codec,
): Promise<StaticPart> {
  const polygons = await decodeModelFaces(head, sections.get('RFAC'), codec);
  const rest = await decodePoints(sections.get('RPTS')!, polygons, head.points, codec);
  const elements = sections.get('ELEM');
  const components = sections.get('COMP');
  const origin = sections.get('ORIG');
  const [unit, colors] = OPTIONAL_TAGS.map((tag) => sections.get(tag));
  const up = unit && decodeUp(unit);
  return {
    system: head.system,
    rest,
    cornerCounts: polygons.counts,
    corners: polygons.corners,
    cage: {
      ...(await decodeCage(head, sections.get('CTRI')!, sections.get('CVTX')!, codec)),
      ...(components && { carriers: decodeCarriers(head, components) }),
    },
    rowsPerFrame: head.rowsPerFrame,
    frameRate: head.frameRate,
    report: null,
    ...(origin === undefined ? {} : { origin: decodeOrigin(origin) }),
    ...(up && { up }),
    ...(colors && { colors: decodePayload(colors.entry, colors.payload) }),
    ...(elements === undefined ? {} : { elements: decodePayload(elements.entry, elements.payload) }),
  };
}

function decodeOrigin({ entry, payload }: Section): Float64Array {
  const origin = new Float64Array(decodePayload(entry, payload).slice().buffer);
  if (!origin.every(Number.isFinite)) throw damaged(entry.offset, 'the origin is not finite');
  return origin;
}

function decodeUp({ entry, payload }: Section): UpAxis | undefined {
  const axis = decodePayload(entry, payload)[8];
  if (axis >= AXES.length) throw damaged(entry.offset, 'the axis that points up is none');
  return AXES[axis];
}

async function decodeModelFaces(head: Head, section: Section | undefined, codec: Codec): Promise<Polygons> {
  if (section === undefined) return NO_POLYGONS;
  const { entry, payload } = section;
  if (isCoded(entry))
    return located(entry, codec.call('faces', [payload, head.points, head.restFaces, head.restCorners]));
  const words = new Uint32Array(decodePayload(entry, payload).buffer);
  const counts = words.slice(0, head.restFaces);
  const corners = words.slice(head.restFaces);
  if (counts.reduce((sum, count) => sum + count, 0) !== corners.length)
    throw damaged(entry.offset, 'the faces of the model do not have as many corners as there are');
  checkIndices(corners, head.points, entry);
  return { counts, corners };
}

async function decodeCage(head: Head, faces: Section, vertices: Section, codec: Codec): Promise<TriangleMesh> {
  const { entry, payload } = faces;
  const { cageVertices, cageFaces } = head;
  if (!isCoded(entry)) {
    const triangles = new Uint32Array(decodePayload(entry, payload).buffer);
    checkIndices(triangles, cageVertices, entry);
    return { positions: await decodePoints(vertices, NO_POLYGONS, cageVertices, codec), triangles };
  }
  const call = codec.call('faces', [payload, cageVertices, cageFaces, 3 * cageFaces]);
  const polygons = await located(entry, call);
  if (polygons.counts.some((count) => count !== 3))
    throw damaged(entry.offset, 'the cage has faces that are no triangles');
  return { positions: await decodePoints(vertices, polygons, cageVertices, codec), triangles: polygons.corners };
}

/** Which component of the cage carries which points. That no face is cut is seen when their coordinates are computed. */
function decodeCarriers(head: Head, { entry, payload }: Section): Carrier[] {
  const words = new Uint32Array(decodePayload(entry, payload).slice().buffer);
  const carriers: Carrier[] = [];
  for (let k = 0; k + 2 < words.length; k += 3)
    carriers.push({ points: words[k], firstVertex: words[k + 1], vertices: words[k + 2] });
  const carried = carriers.reduce((sum, { points }) => sum + points, 0);
  const isWrong = ({ points, firstVertex, vertices }: Carrier) =>
    points === 0 || vertices === 0 || firstVertex + vertices > head.cageVertices;
  if (words.length % 3 !== 0 || carried !== head.points || carriers.some(isWrong))
    throw damaged(entry.offset, 'the components of the cage do not carry the points of the model');
  return carriers;
}

/** Positions, x y z each; coded ones are predicted along these faces. */
async function decodePoints(
  { entry, payload }: Section,
  faces: Polygons,
  count: number,
  codec: Codec,
): Promise<Float64Array> {
  let positions: Float64Array;
  if (isCoded(entry)) {
    positions = await located(entry, codec.call('positions', [payload, faces, count]));
  } else {
    const { buffer } = decodePayload(entry, payload);
    positions = entry.fields.width === 4 ? Float64Array.from(new Float32Array(buffer)) : new Float64Array(buffer);
  }
  const bad = positions.findIndex((x) => !Number.isFinite(x));
  if (bad >= 0) throw damaged(entry.offset, `position ${Math.floor(bad / 3)} is not finite`);
  return positions;
}

function isCoded({ fields }: Entry): boolean {
  return fields.codec === CODEC.codedStatic;
}

/** Says where in the file damage of coded numbers is. */
export async function located<T>(entry: Entry, decoded: Promise<T>): Promise<T> {
  try {
    return await decoded;
  } catch (error) {
    throw error instanceof CodedDataError ? damaged(entry.offset, error.message) : error;
  }
}

function checkIndices(indices: Uint32Array, points: number, entry: Entry): void {
  const bad = indices.find((index) => index >= points);
  if (bad !== undefined) throw damaged(entry.offset, `a face names point ${bad} of ${points}`);
}
