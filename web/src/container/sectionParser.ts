/** The sections of a container that arrives in pieces of any size, one after another. */

import { ByteQueue } from './byteQueue';
import { crc32c } from './crc32c';
import { damaged } from './error';
import { Layout } from './layout';
import type { Section } from './meshes';
import {
  checkFooter,
  checkPrelude,
  type Entry,
  FOOTER_BYTES,
  HEADER_BYTES,
  parseHeader,
  PRELUDE_BYTES,
  sameFields,
  type SectionHeader,
} from './section';
import { parseContents } from './sectionReader';
import { KNOWN_TAGS } from './tag';

/** What arrived: a section's header, all of it, or the end of the container. The payload of an unknown section is not kept. */
export type Arrival =
  | { readonly kind: 'header'; readonly entry: Entry }
  | { readonly kind: 'section'; readonly section: Section; readonly header: Uint8Array; readonly isIntact: boolean }
  | { readonly kind: 'unknown'; readonly entry: Entry; readonly isIntact: boolean }
  | { readonly kind: 'end' };

/** Takes a container apart as far as it came. */
export class SectionParser {
  /** Sections whose headers came. */
  readonly layout = new Layout();
  private readonly queue = new ByteQueue();
  private state: 'prelude' | 'header' | 'payload' | 'unknown' | 'contents' | 'footer' | 'end' = 'prelude';
  private header: { readonly offset: number; readonly bytes: Uint8Array; readonly fields: SectionHeader } | null = null;
  /** Of an unknown section, the bytes still to come and the checksum of those before. */
  private unknown = { left: 0, crc: 0 };

  /** Whether the whole container came. */
  get isAtEnd(): boolean {
    return this.state === 'end';
  }

  /** Bytes that were appended in all. */
  received = 0;

  /** Bytes that wait for more. */
  get waiting(): number {
    return this.queue.length;
  }

  append(piece: Uint8Array): void {
    this.queue.append(piece);
    this.received += piece.length;
  }

  /** Forgets the bytes that wait. */
  clear(): void {
    this.queue.takeUpTo(this.queue.length);
  }

  /**
   * What arrived next; null if it is not all there.
   *
   * @throws {ContainerError} for bytes behind which nothing can be found.
   */
  next(): Arrival | null {
    switch (this.state) {
      case 'prelude':
        return this.take(PRELUDE_BYTES, (bytes) => this.begin(bytes));
      case 'header':
        return this.take(HEADER_BYTES, (bytes) => this.beginSection(bytes));
      case 'payload':
        return this.take(this.header!.fields.payloadBytes, (bytes) => this.endSection(bytes));
      case 'unknown':
        return this.passOver();
      case 'contents':
        return this.take(this.header!.fields.payloadBytes, (bytes) => this.checkContents(bytes));
      case 'footer':
        return this.take(FOOTER_BYTES, (bytes) => this.end(bytes));
      default:
        return null;
    }
  }

  /** Checks the beginning of a container that ended before its prelude did. */
  checkBeginning(): void {
    if (this.state === 'prelude') {
      checkPrelude(this.queue.takeUpTo(PRELUDE_BYTES));
    }
  }

  private take(length: number, parse: (bytes: Uint8Array) => Arrival | null): Arrival | null {
    const bytes = this.queue.take(length);
    return bytes === null ? null : parse(bytes);
  }

  private begin(bytes: Uint8Array): Arrival | null {
    checkPrelude(bytes);
    this.state = 'header';
    return this.next();
  }

  private beginSection(bytes: Uint8Array): Arrival | null {
    const offset = this.layout.end;
    const fields = parseHeader(bytes, offset);
    this.header = { offset, bytes, fields };
    if (fields.tag === 'TOC_') {
      this.state = 'contents';
      return this.next();
    }
    this.layout.add({ offset, fields });
    if (KNOWN_TAGS.has(fields.tag)) {
      this.state = 'payload';
    } else {
      this.state = 'unknown';
      this.unknown = { left: fields.payloadBytes, crc: 0 };
    }
    return { kind: 'header', entry: { offset, fields } };
  }

  private endSection(payload: Uint8Array): Arrival {
    const { offset, bytes: header, fields } = this.header!;
    this.state = 'header';
    const isIntact = crc32c(payload) === fields.payloadCrc;
    return { kind: 'section', section: { entry: { offset, fields }, payload }, header, isIntact };
  }

  private passOver(): Arrival | null {
    const bytes = this.queue.takeUpTo(this.unknown.left);
    this.unknown = { left: this.unknown.left - bytes.length, crc: crc32c(bytes, this.unknown.crc) };
    if (this.unknown.left > 0) {
      return null;
    }
    const { offset, fields } = this.header!;
    this.state = 'header';
    return { kind: 'unknown', entry: { offset, fields }, isIntact: this.unknown.crc === fields.payloadCrc };
  }

  /** Compares the table of contents with the sections that came. */
  private checkContents(payload: Uint8Array): Arrival | null {
    const { offset, bytes } = this.header!;
    const whole = new Uint8Array(bytes.length + payload.length);
    whole.set(bytes);
    whole.set(payload, bytes.length);
    const listed = parseContents(whole, offset);
    let isSame = listed.length === this.layout.length;
    for (let k = 0; isSame && k < listed.length; k++) {
      isSame = sameFields(listed.at(k).fields, this.layout.at(k).fields);
    }
    if (!isSame) {
      throw damaged(offset, 'the table of contents differs from the sections');
    }
    this.state = 'footer';
    return this.next();
  }

  private end(bytes: Uint8Array): Arrival {
    const { offset, fields } = this.header!;
    const end = offset + HEADER_BYTES + fields.payloadBytes;
    if (checkFooter(bytes, end + FOOTER_BYTES) !== offset) {
      throw damaged(end, 'the table of contents is not where the end says');
    }
    this.state = 'end';
    return { kind: 'end' };
  }
}
