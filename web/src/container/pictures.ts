/** `pict`: the files of the pictures that materials name; docs/FORMAT.md. */

import { decodePayload } from './codecs';
import { damaged } from './error';
import type { Section } from './meshes';
import { arrayOf, countOf, jsonBehindLength, objectOf } from './surface';

const MAX_PICTURES = 4096;

/** The bytes of each picture by its path. */
export type Pictures = ReadonlyMap<string, Uint8Array<ArrayBuffer>>;

export function parsePictures({ entry, payload }: Section): Pictures {
  const fail = (what: string) => () => damaged(entry.offset, `the list of pictures ${what}`);
  const cannotBeRead = fail('cannot be read');
  const { json, rest } = jsonBehindLength(decodePayload(entry, payload), cannotBeRead);
  const listed = arrayOf(json, cannotBeRead);
  if (listed.length > MAX_PICTURES) throw fail('is longer than any program writes')();
  const found = new Map<string, Uint8Array<ArrayBuffer>>();
  for (const each of listed) {
    const { path, first, bytes } = objectOf(each, cannotBeRead);
    const [start, count] = [countOf(first, cannotBeRead), countOf(bytes, cannotBeRead)];
    if (typeof path !== 'string' || start + count > rest.length) throw fail('names bytes that are not there')();
    found.set(path, rest.subarray(start, start + count) as Uint8Array<ArrayBuffer>);
  }
  return found;
}
