/** The sections of a container that arrives in pieces of any size, one after another. */

import { crc32c } from './crc32c';
import { Layout } from './layout';
import type { Section } from './meshes';
import {
  checkPrelude,
  type Entry,
  HEADER_BYTES,
  parseHeader,
  PRELUDE_BYTES,
  type SectionHeader,
  KNOWN_TAGS,
} from './section';

/** What arrived: a section's header, all of it, or the table of contents that ends the sections. Unknown sections are passed over. */
export type Arrival =
  | { readonly kind: 'header'; readonly entry: Entry }
  | { readonly kind: 'section'; readonly section: Section; readonly header: Uint8Array; readonly isIntact: boolean }
  | { readonly kind: 'end' };

/** Takes a container apart as far as it came. */
export class SectionParser {
  /** Sections whose headers came. */
  readonly layout = new Layout();
  private readonly queue = new ByteQueue();
  private state: 'prelude' | 'header' | 'payload' | 'end' = 'prelude';
  private header: { readonly offset: number; readonly bytes: Uint8Array; readonly fields: SectionHeader } | null = null;
  /** Bytes of an unknown section that are still to come. */
  private unknown = 0;

  received = 0;

  append(piece: Uint8Array): void {
    this.queue.append(piece);
    this.received += piece.length;
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
        this.unknown -= this.queue.takeUpTo(this.unknown).length;
        return this.take(HEADER_BYTES, (bytes) => this.beginSection(bytes));
      case 'payload':
        return this.take(this.header!.fields.payloadBytes, (bytes) => this.endSection(bytes));
      default:
        return null;
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

  private beginSection(bytes: Uint8Array): Arrival {
    const offset = this.layout.end;
    const fields = parseHeader(bytes, offset);
    if (fields.tag === 'TOC_') {
      this.state = 'end';
      return { kind: 'end' };
    }
    const entry = { offset, fields };
    this.layout.add(entry);
    if (KNOWN_TAGS.has(fields.tag)) {
      this.header = { offset, bytes, fields };
      this.state = 'payload';
    } else {
      this.unknown = fields.payloadBytes;
    }
    return { kind: 'header', entry };
  }

  private endSection(payload: Uint8Array): Arrival {
    const { offset, bytes: header, fields } = this.header!;
    this.state = 'header';
    const isIntact = crc32c(payload) === fields.payloadCrc;
    return { kind: 'section', section: { entry: { offset, fields }, payload }, header, isIntact };
  }
}

/** Bytes that arrive in pieces of any size and are taken in pieces of others. */
export class ByteQueue {
  private buffer = new Uint8Array(1 << 12);
  private start = 0;
  private end = 0;

  get length(): number {
    return this.end - this.start;
  }

  append(piece: Uint8Array): void {
    if (this.end + piece.length > this.buffer.length) {
      const needed = this.length + piece.length;
      const target = needed > this.buffer.length / 2 ? new Uint8Array(2 * needed) : this.buffer;
      target.set(this.buffer.subarray(this.start, this.end));
      [this.buffer, this.start, this.end] = [target, 0, this.length];
    }
    this.buffer.set(piece, this.end);
    this.end += piece.length;
  }

  /** Takes so many bytes from the front, a copy; null if there are fewer. */
  take(length: number): Uint8Array | null {
    if (length > this.length) return null;
    this.start += length;
    return this.buffer.slice(this.start - length, this.start);
  }

  /** Takes all there is, at most so many bytes. */
  takeUpTo(length: number): Uint8Array {
    return this.take(Math.min(length, this.length))!;
  }
}
