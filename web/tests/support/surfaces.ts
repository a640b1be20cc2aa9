/** A capture with parts, materials and texture coordinates, and what tests change of it. */

import { readFileSync } from 'node:fs';
import { decodePayload } from '../../src/container/codecs';
import type { Section } from '../../src/container/meshes';
import { parseFields, viewOf } from '../../src/container/section';
import { type Part, putTogether, rawPart, takeApart, withPart } from './containers';

export function surfaceBytes(): Uint8Array<ArrayBuffer> {
  return new Uint8Array(readFileSync(new URL('../../src/codec/testdata/surface.cager', import.meta.url)));
}

/** The section with what lies on the faces, its JSON, and the bytes behind that. */
export function namesOf(bytes: Uint8Array): { section: Section; json: string; rest: Uint8Array } {
  const { header, payload } = takeApart(bytes).find(isSurface)!;
  const section = { entry: { offset: 0, fields: parseFields(header, 0) }, payload };
  const raw = decodePayload(section.entry, payload);
  const end = 4 + viewOf(raw).getUint32(0, true);
  return { section, json: new TextDecoder().decode(raw.subarray(4, end)), rest: raw.subarray(end) };
}

/** The container with other names: JSON, as a function of what it was. */
export function withNames(bytes: Uint8Array, change: (json: string) => string): Uint8Array<ArrayBuffer> {
  const { json, rest } = namesOf(bytes);
  const part = rawPart('surf', behindLength(change(json), rest));
  return putTogether(takeApart(bytes).map((each) => (isSurface(each) ? part : each)));
}

/** The container with pictures. */
export function withPictures(bytes: Uint8Array, files: Readonly<Record<string, Uint8Array>>): Uint8Array<ArrayBuffer> {
  let first = 0;
  const listed = Object.entries(files).map(([path, { length }]) => {
    first += length;
    return { path, first: first - length, bytes: length };
  });
  const payload = behindLength(JSON.stringify(listed), Buffer.concat(Object.values(files)));
  return withPart(bytes, rawPart('pict', payload), 'surf');
}

function isSurface({ header }: Part): boolean {
  return parseFields(header, 0).tag === 'surf';
}

function behindLength(json: string, rest: Uint8Array): Uint8Array<ArrayBuffer> {
  const text = new TextEncoder().encode(json);
  const bytes = new Uint8Array(4 + text.length + rest.length);
  viewOf(bytes).setUint32(0, text.length, true);
  bytes.set(text, 4);
  bytes.set(rest, 4 + text.length);
  return bytes;
}
