/** `surf`: what a scene says of the faces of the model; docs/FORMAT.md. */

import type { Material, ModelPart, ModelSurface, StaticPart, Texture, TextureChannel } from '../capture';
import type { Codec } from '../codec/client';
import type { PartSize } from '../codec/surface/decodeSurface';
import { decodePayload } from './codecs';
import { damaged } from './error';
import type { Head } from './head';
import { located, type Section } from './meshes';
import { viewOf } from './section';

/** What the section names, and the numbers that follow. */
export interface SurfaceNames {
  readonly parts: readonly ModelPart[];
  readonly sizes: readonly PartSize[];
  readonly materials: readonly Material[];
  /** The order of the faces and the streams of all parts. */
  readonly numbers: Uint8Array;
}

/** Stands in the path of a picture in tiles for the number of one. */
export const TILES = '<UDIM>';

const CHANNELS: readonly string[] = ['base_color', 'opacity', 'roughness', 'metalness'] satisfies TextureChannel[];

type Json = Readonly<Record<string, unknown>>;

export async function decodeSurface(
  section: Section,
  head: Head,
  { cornerCounts, corners }: Pick<StaticPart, 'cornerCounts' | 'corners'>,
  codec: Codec,
): Promise<ModelSurface> {
  const { parts, sizes, materials, numbers } = parseSurface(section, head);
  const isTiled = materials.map(({ textures }) => textures.some(({ path }) => path.includes(TILES)));
  const faces = { counts: cornerCounts, corners };
  const mesh = codec.call('surface', [numbers, sizes, isTiled, faces, head.points]);
  return { parts, materials, mesh: await located(section.entry, mesh) };
}

/** Parts and materials, whose numbers are still coded. */
export function parseSurface({ entry, payload }: Section, head: Head): SurfaceNames {
  const cannotBeRead = () => damaged(entry.offset, 'what lies on the faces cannot be read');
  const { json, rest } = jsonBehindLength(decodePayload(entry, payload), cannotBeRead);
  const { parts = [], materials = [] } = objectOf(json, cannotBeRead);
  const list = (value: unknown) => arrayOf(value, cannotBeRead).map((each) => objectOf(each, cannotBeRead));
  const partList = list(parts);
  const sizes = partList.map((part) => sizeOf(part, cannotBeRead));
  const sum = (of: 'points' | 'faces') => sizes.reduce((all, size) => all + size[of], 0);
  if (sum('points') !== head.points || sum('faces') !== head.restFaces)
    throw damaged(entry.offset, 'parts are not those of the mesh');
  let firstPoint = 0;
  const named = partList.map((part, k): ModelPart => {
    const { points } = sizes[k];
    firstPoint += points;
    const shown = (part.shown ?? null) === null ? null : list(part.shown).map((range) => rangeOf(range, cannotBeRead));
    return { path: textOf(part.path), firstPoint: firstPoint - points, points, shown };
  });
  return { parts: named, sizes, materials: list(materials).map((each) => materialOf(each, list)), numbers: rest };
}

/** JSON behind a u32 with its length, and the bytes after it. */
export function jsonBehindLength(bytes: Uint8Array, fail: () => Error): { json: unknown; rest: Uint8Array } {
  const end = bytes.length < 4 ? Infinity : 4 + viewOf(bytes).getUint32(0, true);
  if (end > bytes.length) throw fail();
  try {
    const text = new TextDecoder('utf-8', { fatal: true }).decode(bytes.subarray(4, end));
    return { json: JSON.parse(text) as unknown, rest: bytes.subarray(end) };
  } catch {
    throw fail();
  }
}

export function arrayOf(value: unknown, fail: () => Error): unknown[] {
  if (!Array.isArray(value)) throw fail();
  return value;
}

export function objectOf(value: unknown, fail: () => Error): Json {
  if (typeof value !== 'object' || value === null || Array.isArray(value)) throw fail();
  return value as Json;
}

/** A number of things; nothing is none of them. */
export function countOf(value: unknown, fail: () => Error): number {
  const count = value ?? 0;
  if (!Number.isSafeInteger(count) || (count as number) < 0) throw fail();
  return count as number;
}

function sizeOf(part: Json, fail: () => Error): PartSize {
  const lengthOf = (value: unknown) => (value === undefined ? 0 : arrayOf(value, fail).length);
  return {
    points: countOf(part.points, fail),
    faces: countOf(part.faces, fail),
    uvSets: lengthOf(part.uv_sets),
    colorSets: lengthOf(part.color_sets),
    groups: lengthOf(part.groups),
    isTilted: (part.tilts ?? null) !== null,
  };
}

function rangeOf({ start, end }: Json, fail: () => Error): readonly [number, number] {
  return [countOf(start, fail), countOf(end, fail)];
}

function materialOf(json: Json, list: (value: unknown) => Json[]): Material {
  const color = Array.isArray(json.base_color) ? json.base_color : [];
  return {
    name: textOf(json.name),
    baseColor: [0, 1, 2].map((k) => numberOf(color[k], 0.8)) as [number, number, number],
    opacity: numberOf(json.opacity, 1),
    roughness: numberOf(json.roughness, 0.5),
    metalness: numberOf(json.metalness, 0),
    textures: (json.textures === undefined ? [] : list(json.textures)).flatMap(textureOf),
  };
}

/** Of channels that are not drawn nothing. */
function textureOf({ channel, path }: Json): Texture[] {
  return CHANNELS.includes(textOf(channel)) ? [{ channel: channel as TextureChannel, path: textOf(path) }] : [];
}

function textOf(value: unknown): string {
  return typeof value === 'string' ? value : '';
}

function numberOf(value: unknown, otherwise: number): number {
  return typeof value === 'number' && Number.isFinite(value) ? value : otherwise;
}
