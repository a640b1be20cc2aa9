/** Chunks of frames of a container that arrives from front to back: their sections are checked, and kept as they are in the file. */

import { decodePayload } from './codecs';
import { checksumDamage, damaged } from './error';
import { checkHeadSection, type Head, parseHead } from './head';
import { checkSize } from './layout';
import type { Section } from './meshes';
import { type Entry, HEADER_BYTES } from './section';
import { type Arrival, SectionParser } from './sectionParser';
import { KNOWN_TAGS } from './tag';

/** A section and its header as it is in the file. */
export interface StoredSection extends Section {
  readonly header: Uint8Array;
}

/** Frames that are in one section, and the residual before it. */
export interface StoredChunk {
  readonly frames: StoredSection;
  readonly residual: StoredSection | null;
}

/** Takes a container in pieces and gives the chunks that are whole, undecoded. */
export class ChunkStream {
  private readonly parser = new SectionParser();
  private head: Head | null = null;
  private residual: StoredSection | null = null;
  /** Frames whose sections began, and bytes that these take. */
  private begun = { frames: 0, bytes: 0 };

  /** Bytes that came. */
  get received(): number {
    return this.parser.received;
  }

  /** Bytes that a frame takes, as of the sections that began; null before the first of them. */
  get bytesPerFrame(): number | null {
    return this.begun.frames > 0 ? this.begun.bytes / this.begun.frames : null;
  }

  /** @throws {ContainerError} for bytes behind which nothing can be found, and for damaged frames. */
  *push(piece: Uint8Array): Generator<StoredChunk, void, undefined> {
    this.parser.append(piece);
    for (let arrival = this.parser.next(); arrival !== null; arrival = this.parser.next()) {
      const chunk = this.take(arrival);
      if (chunk !== null) {
        yield chunk;
      }
    }
  }

  private take(arrival: Arrival): StoredChunk | null {
    if (arrival.kind === 'header') {
      this.check(arrival.entry);
    }
    if (arrival.kind !== 'section') {
      return null;
    }
    const { section, header, isIntact } = arrival;
    const { entry, payload } = section;
    const { tag } = entry.fields;
    if (!isIntact) {
      throw checksumDamage(entry.offset);
    }
    if (tag === 'HEAD') {
      this.head = parseHead(decodePayload(entry, payload), entry.offset);
    } else if (tag === 'resi') {
      this.residual = { ...section, header };
    } else if (tag === 'FRAM') {
      const { residual } = this;
      this.residual = null;
      return { frames: { ...section, header }, residual };
    }
    return null;
  }

  /** Checks what a section says before its payload is waited for. */
  private check(entry: Entry): void {
    const { layout } = this.parser;
    const { tag, first, count, payloadBytes } = entry.fields;
    if (tag === 'HEAD') {
      checkHeadSection(entry);
    } else if (KNOWN_TAGS.has(tag)) {
      if (this.head === null) {
        throw damaged(entry.offset, 'the section HEAD is missing');
      }
      checkSize(entry, this.head, layout.frames, layout.end);
    }
    if (tag === 'resi' || tag === 'FRAM') {
      this.begun = { frames: first + count, bytes: this.begun.bytes + HEADER_BYTES + payloadBytes };
    }
  }
}
