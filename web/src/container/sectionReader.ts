/** Sections of a container that can be read at random: both ends, the table of contents, and payloads with their checks. */

import { crc32c } from './crc32c';
import { checksumDamage, damaged, isDamage } from './error';
import { Layout } from './layout';
import type { Section } from './meshes';
import * as section from './section';
import type { Source } from './source';

/** Sections that lie next to each other are read together up to this many bytes. */
const TOGETHER_BYTES = 2 ** 24;

/** The sections that the table of contents of an intact file lists. */
export async function readContents(source: Source, signal?: AbortSignal): Promise<Layout> {
  const fileBytes = source.size;
  if (fileBytes < section.PRELUDE_BYTES + section.HEADER_BYTES + section.FOOTER_BYTES)
    throw damaged(fileBytes, 'the file was cut');
  const end = fileBytes - section.FOOTER_BYTES;
  const offset = section.checkFooter(await source.read(end, section.FOOTER_BYTES, signal), fileBytes);
  if (offset < section.PRELUDE_BYTES || offset + section.HEADER_BYTES > end)
    throw damaged(end, 'the table of contents lies outside the file');
  const bytes = await source.read(offset, end - offset, signal);
  return parseContents(bytes, offset);
}

/** The sections that the section `TOC_` lists, given with its header. */
function parseContents(bytes: Uint8Array, offset: number): Layout {
  const header = section.parseHeader(bytes.subarray(0, section.HEADER_BYTES), offset);
  const payload = bytes.subarray(section.HEADER_BYTES);
  const isRaw = header.codec === section.CODEC.raw && header.rawBytes === payload.length;
  if (header.tag !== 'TOC_' || !isRaw || header.payloadBytes !== payload.length)
    throw damaged(offset, 'there is no table of contents where the end says');
  if (crc32c(payload) !== header.payloadCrc) throw checksumDamage(offset);
  if (payload.length % section.ENTRY_BYTES !== 0) throw damaged(offset, 'the table of contents is cut');
  const layout = new Layout();
  for (let at = 0; at < payload.length; at += section.ENTRY_BYTES) {
    const line = payload.subarray(at, at + section.ENTRY_BYTES);
    const start = section.safeInteger(section.viewOf(line), 0, offset);
    // Sections follow each other without gaps, so that no byte of the file goes unchecked.
    if (start !== layout.end) throw damaged(offset, 'the table of contents leaves a gap');
    layout.add({ offset: start, fields: section.parseFields(line.subarray(8), offset) });
    if (layout.end > offset) throw damaged(offset, 'the table of contents lists a section beyond itself');
  }
  if (layout.end !== offset) throw damaged(offset, 'the table of contents does not list all sections');
  return layout;
}

/** The sections from front to back, up to the first whose header is damaged or whose payload is not all there. */
export async function scanSections(source: Source, signal?: AbortSignal): Promise<Layout> {
  const layout = new Layout();
  while (layout.end + section.HEADER_BYTES <= source.size) {
    const offset = layout.end;
    const bytes = await source.read(offset, section.HEADER_BYTES, signal);
    try {
      const fields = section.parseHeader(bytes, offset);
      if (offset + section.HEADER_BYTES + fields.payloadBytes > source.size || fields.tag === 'TOC_') break;
      layout.add({ offset, fields });
    } catch (error) {
      if (isDamage(error)) break;
      throw error;
    }
  }
  return layout;
}

/** Reads the payloads of some sections in the order of the file, those next to each other by one request. */
export async function readSections(
  source: Source,
  entries: readonly section.Entry[],
  signal?: AbortSignal,
): Promise<Section[]> {
  const sections: Section[] = [];
  for (let start = 0; start < entries.length;) {
    let next = start + 1;
    const offset = entries[start].offset;
    while (next < entries.length && continues(entries, next, offset)) next++;
    const bytes = await source.read(offset, endOf(entries[next - 1]) - offset, signal);
    for (const entry of entries.slice(start, next)) {
      sections.push({
        entry,
        payload: checkSection(entry, bytes.subarray(entry.offset - offset, endOf(entry) - offset)),
      });
    }
    start = next;
  }
  return sections;
}

function continues(entries: readonly section.Entry[], next: number, offset: number): boolean {
  return entries[next].offset === endOf(entries[next - 1]) && endOf(entries[next]) - offset <= TOGETHER_BYTES;
}

function endOf({ offset, fields }: section.Entry): number {
  return offset + section.HEADER_BYTES + fields.payloadBytes;
}

/** Checks a section as it is in the file against its entry and its checksums; returns its payload. */
function checkSection({ offset, fields }: section.Entry, bytes: Uint8Array): Uint8Array {
  const header = section.parseHeader(bytes.subarray(0, section.HEADER_BYTES), offset);
  if (!section.sameFields(header, fields)) throw damaged(offset, 'a section differs from the table of contents');
  const payload = bytes.subarray(section.HEADER_BYTES);
  if (crc32c(payload) !== header.payloadCrc) throw checksumDamage(offset);
  return payload;
}
