/** Writes containers again with other layers of edits: all other sections keep their bytes; docs/FORMAT.md. */

import type { EditLayer } from '../capture';
import { crc32c } from './crc32c';
import { ContainerError, isDamage } from './error';
import { decodeLayer, encodeLayer, type StoredLayer } from './layers';
import type { Layout } from './layout';
import { readHead } from './open';
import { readContents, readSections } from './sectionReader';
import {
  ENTRY_BYTES,
  FOOTER_BYTES,
  FOOTER_MAGIC,
  HEADER_BYTES,
  PRELUDE_BYTES,
  type SectionFields,
  viewOf,
} from './section';
import type { Source } from './source';

/** Bytes that are read at once. */
const PIECE_BYTES = 4 << 20;

export interface RewriteOptions {
  readonly signal?: AbortSignal;
  /** Hears the part that is done, 0 to 1. */
  readonly onProgress?: (fraction: number) => void;
}

/**
 * A container again, with these layers of edits in place of those that it has, behind all other sections. Those that are as they were in the file keep their bytes too.
 *
 * @throws {ContainerError} where the container is damaged, also one of its layers alone: nobody who left that out chose to
 */
export async function withEdits(
  source: Source,
  layers: readonly (EditLayer | StoredLayer)[],
  { signal, onProgress }: RewriteOptions = {},
): Promise<Blob> {
  const layout = await readContents(source, signal);
  await checkLayersLeftOut(source, layout, layers, signal);
  // Blobs may leave memory; an array of the whole file would not.
  const pieces: Blob[] = [];
  const contents: Uint8Array[] = [];
  let length = 0;
  const push = (...parts: Uint8Array<ArrayBuffer>[]) => {
    const piece = new Blob(parts);
    pieces.push(piece);
    length += piece.size;
  };
  const copy = async (offset: number, bytes: number) => {
    for (let at = 0; at < bytes; at += PIECE_BYTES) {
      push((await source.read(offset + at, Math.min(PIECE_BYTES, bytes - at), signal)) as Uint8Array<ArrayBuffer>);
      onProgress?.(Math.min(1, length / source.size));
    }
  };
  const list = (header: Uint8Array) => {
    const entry = new Uint8Array(ENTRY_BYTES);
    viewOf(entry).setBigUint64(0, BigInt(length), true);
    entry.set(header.subarray(0, ENTRY_BYTES - 8), 8);
    contents.push(entry);
  };
  await copy(0, PRELUDE_BYTES);
  const copySection = async ({ offset, fields }: StoredLayer['stored']['entry']) => {
    list(headerOf(fields));
    await copy(offset, HEADER_BYTES + fields.payloadBytes);
  };
  for (const entry of layout.entries) if (!layout.layers.includes(entry)) await copySection(entry);
  for (const layer of layers) {
    if ('stored' in layer && layer.stored.isOn === layer.isOn) {
      await copySection(layer.stored.entry);
      continue;
    }
    const payload = encodeLayer(layer);
    const { length: bytes } = payload;
    const { first, count } = layer;
    const header = headerOf(
      { tag: 'EDIT', codec: 0, width: 4, first, count, payloadBytes: bytes, rawBytes: bytes },
      payload,
    );
    list(header);
    push(header, payload);
  }
  const table = new Uint8Array(await new Blob(contents as Uint8Array<ArrayBuffer>[]).arrayBuffer());
  const footer = footerOf(length, length + HEADER_BYTES + table.length + FOOTER_BYTES);
  const fields = { codec: 0, width: 1, first: 0, count: 0, payloadBytes: table.length, rawBytes: table.length };
  push(headerOf({ tag: 'TOC_', ...fields }, table), table, footer);
  return new Blob(pieces, { type: 'application/vnd.cager' });
}

/** Checks that layers of the file that are not among these can be read, so that they were shown and taken out. */
async function checkLayersLeftOut(
  source: Source,
  layout: Layout,
  layers: readonly (EditLayer | StoredLayer)[],
  signal?: AbortSignal,
): Promise<void> {
  const kept = new Set(layers.map((layer) => ('stored' in layer ? layer.stored.entry.offset : null)));
  const leftOut = layout.layers.filter(({ offset }) => !kept.has(offset));
  if (leftOut.length === 0) return;
  const head = await readHead(source, layout, signal);
  for (const entry of leftOut) {
    try {
      const [section] = await readSections(source, [entry], signal);
      decodeLayer(section, head, layout.frames);
    } catch (error) {
      if (!isDamage(error)) throw error;
      const number = layout.layers.indexOf(entry) + 1;
      const what = `Layer ${number} of the file's edits is damaged and would be lost.`;
      throw new ContainerError('damaged', `${what} Take it out with cager edit --remove ${number} first.`);
    }
  }
}

/** The header of a section; without its payload, what of it the table of contents has. */
function headerOf(fields: SectionFields, payload = new Uint8Array(0)): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(HEADER_BYTES);
  const view = viewOf(bytes);
  bytes.set(new TextEncoder().encode(fields.tag));
  bytes[4] = fields.codec;
  bytes[5] = fields.width;
  view.setUint32(8, fields.first, true);
  view.setUint32(12, fields.count, true);
  view.setBigUint64(16, BigInt(fields.payloadBytes), true);
  view.setBigUint64(24, BigInt(fields.rawBytes), true);
  view.setUint32(32, crc32c(payload), true);
  view.setUint32(36, crc32c(bytes.subarray(0, 36)), true);
  return bytes;
}

function footerOf(contentsOffset: number, fileBytes: number): Uint8Array<ArrayBuffer> {
  const footer = new Uint8Array(FOOTER_BYTES);
  const view = viewOf(footer);
  view.setBigUint64(0, BigInt(contentsOffset), true);
  view.setBigUint64(8, BigInt(fileBytes), true);
  footer.set(FOOTER_MAGIC, 16);
  view.setUint32(20, crc32c(footer.subarray(0, 20)), true);
  return footer;
}
