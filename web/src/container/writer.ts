/** Writes containers from front to back; docs/FORMAT.md. */

import { crc32c } from './crc32c';
import {
  ENTRY_BYTES,
  FOOTER_BYTES,
  FOOTER_MAGIC,
  HEADER_BYTES,
  MAGIC,
  PRELUDE_BYTES,
  type SectionFields,
  viewOf,
} from './section';

const VERSION = 1;

/** What a section's header says beside its lengths, which are those of its payload where nothing else is said. */
export type NewSection = Pick<SectionFields, 'tag'> & Partial<Omit<SectionFields, 'payloadBytes'>>;

/** Puts sections together to a container; the table of contents and the end come from {@link finish}. */
export class ContainerWriter {
  private readonly pieces: Uint8Array<ArrayBuffer>[] = [prelude()];
  private readonly entries: Uint8Array[] = [];
  private length = PRELUDE_BYTES;

  /** Adds a section with a payload as it is to be in the file, raw where no codec is named. The payload must not change any more. */
  add(section: NewSection, payload: Uint8Array<ArrayBuffer>): void {
    const entry = new Uint8Array(ENTRY_BYTES);
    const header = headerOf(section, payload);
    viewOf(entry).setBigUint64(0, BigInt(this.length), true);
    entry.set(header.subarray(0, ENTRY_BYTES - 8), 8);
    this.entries.push(entry);
    this.push(header, payload);
  }

  /** The whole container. Nothing can be added behind. */
  finish(): Blob {
    const contents = new Uint8Array(ENTRY_BYTES * this.entries.length);
    this.entries.forEach((entry, k) => contents.set(entry, ENTRY_BYTES * k));
    const offset = this.length;
    this.push(headerOf({ tag: 'TOC_' }, contents), contents);
    const footer = new Uint8Array(FOOTER_BYTES);
    const view = viewOf(footer);
    view.setBigUint64(0, BigInt(offset), true);
    view.setBigUint64(8, BigInt(this.length + FOOTER_BYTES), true);
    footer.set(FOOTER_MAGIC, 16);
    view.setUint32(20, crc32c(footer.subarray(0, 20)), true);
    this.push(footer);
    return new Blob(this.pieces, { type: 'application/vnd.cager' });
  }

  private push(...pieces: Uint8Array<ArrayBuffer>[]): void {
    for (const piece of pieces) {
      this.pieces.push(piece);
      this.length += piece.length;
    }
  }
}

function prelude(): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(PRELUDE_BYTES);
  bytes.set(MAGIC);
  viewOf(bytes).setUint16(8, VERSION, true);
  viewOf(bytes).setUint32(12, crc32c(bytes.subarray(0, 12)), true);
  return bytes;
}

function headerOf(section: NewSection, payload: Uint8Array): Uint8Array<ArrayBuffer> {
  const { tag, codec = 0, width = 1, first = 0, count = 0, rawBytes = payload.length } = section;
  const bytes = new Uint8Array(HEADER_BYTES);
  const view = viewOf(bytes);
  bytes.set(new TextEncoder().encode(tag));
  bytes[4] = codec;
  bytes[5] = width;
  view.setUint32(8, first, true);
  view.setUint32(12, count, true);
  view.setBigUint64(16, BigInt(payload.length), true);
  view.setBigUint64(24, BigInt(rawBytes), true);
  view.setUint32(32, crc32c(payload), true);
  view.setUint32(36, crc32c(bytes.subarray(0, 36)), true);
  return bytes;
}
