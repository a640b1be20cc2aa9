/** A container that is read from front to back while it arrives, as that of a session that is still running. */

import type { ModelSurface, StaticPart } from '../capture';
import type { Codec } from '../codec/client';
import { decodePayload } from './codecs';
import { checksumDamage, damaged, isTolerable } from './error';
import { checkHeadSection, type Head, parseHead } from './head';
import { checkSize } from './layout';
import { decodeStatic, OPTIONAL_TAGS, type Section, STATIC_TAGS, SURFACE_TAGS } from './meshes';
import { parsePictures, type Pictures } from './pictures';
import { type Entry, HEADER_BYTES, KNOWN_TAGS } from './section';
import { type Arrival, SectionParser } from './sectionParser';
import { decodeSurface } from './surface';

/** A section and its header as it is in the file. */
export interface StoredSection extends Section {
  readonly header: Uint8Array;
}

/** Frames that are in one section, and the residual before it. */
export interface StoredChunk {
  readonly frames: StoredSection;
  readonly residual: StoredSection | null;
}

/** Takes a container in pieces of any size: first model and cage, then chunks of frames, undecoded. */
export class ContainerStream {
  private readonly parser = new SectionParser();
  private readonly sections = new Map<string, Section>();
  private head: Head | null = null;
  private residual: StoredSection | null = null;
  /** Whether model and cage are there. */
  private isBegun = false;
  /** Frames whose sections began, and bytes that these take. */
  private begun = { frames: 0, bytes: 0 };

  get received(): number {
    return this.parser.received;
  }

  /** Bytes that a frame takes, as of the sections that began; null before the first of them. */
  get bytesPerFrame(): number | null {
    return this.begun.frames > 0 ? this.begun.bytes / this.begun.frames : null;
  }

  /**
   * Takes a piece, and looks at it as far as model and cage; whether these are whole.
   *
   * @throws {ContainerError} where the bytes are no container, need a later program, or model or cage are damaged
   */
  begin(piece: Uint8Array): boolean {
    this.parser.append(piece);
    while (!this.isBegun) {
      const arrival = this.parser.next();
      if (arrival === null) break;
      this.take(arrival);
    }
    return this.isBegun;
  }

  /** Model and cage, which are whole. Colours and unit that are damaged, or come later, are left out. */
  decodeStatic(codec: Codec): Promise<StaticPart> {
    const { layout } = this.parser;
    const head = this.headBefore(layout.end);
    layout.checkStatic(head);
    return decodeStatic(head, this.sections, codec);
  }

  /** Parts and materials that came with model and cage; null where there are none, or they are damaged. */
  async surface(part: StaticPart, codec: Codec): Promise<ModelSurface | null> {
    const section = this.sections.get('surf');
    return section ? unlessDamaged(section, () => decodeSurface(section, this.head!, part, codec)) : null;
  }

  /** Their pictures, as far as {@link surface}. */
  async pictures(): Promise<Pictures> {
    const section = this.sections.get('pict');
    return (section && (await unlessDamaged(section, () => parsePictures(section)))) ?? new Map();
  }

  /**
   * Takes a piece; gives the chunks that are whole.
   *
   * @throws {ContainerError} for bytes behind which nothing can be found, and for damaged frames.
   */
  *push(piece: Uint8Array): Generator<StoredChunk, void, undefined> {
    this.parser.append(piece);
    for (let arrival = this.parser.next(); arrival !== null; arrival = this.parser.next()) {
      const chunk = this.take(arrival);
      if (chunk !== null) yield chunk;
    }
  }

  private take(arrival: Arrival): StoredChunk | null {
    if (arrival.kind === 'header') this.check(arrival.entry);
    if (arrival.kind === 'end') this.isBegun = true;
    return arrival.kind === 'section' ? this.takeSection(arrival) : null;
  }

  /** Checks what a section says before its payload is waited for. */
  private check(entry: Entry): void {
    const { tag, first, count, payloadBytes } = entry.fields;
    const { layout } = this.parser;
    if (tag === 'HEAD') checkHeadSection(entry);
    else if (KNOWN_TAGS.has(tag)) {
      checkSize(entry, this.headBefore(entry.offset), layout.frames, layout.end);
      // Colours and unit may be among the sections of the static part, or anywhere else.
      this.isBegun ||= ![STATIC_TAGS, OPTIONAL_TAGS, SURFACE_TAGS].some((tags) => tags.includes(tag));
    }
    if (tag === 'resi' || tag === 'FRAM')
      this.begun = { frames: first + count, bytes: this.begun.bytes + HEADER_BYTES + payloadBytes };
  }

  private takeSection({ section, header, isIntact }: Arrival & { kind: 'section' }): StoredChunk | null {
    const { entry, payload } = section;
    const { tag } = entry.fields;
    const isOptional = OPTIONAL_TAGS.includes(tag);
    const isOfSurface = SURFACE_TAGS.includes(tag);
    try {
      if (!isIntact) throw checksumDamage(entry.offset);
      if (isOptional) decodePayload(entry, payload);
      if (tag === 'HEAD') this.head = parseHead(decodePayload(entry, payload), entry.offset);
    } catch (error) {
      if (!(isOptional || isOfSurface) || !isTolerable(error, tag)) throw error;
      return null;
    }
    if (isOptional || isOfSurface || STATIC_TAGS.includes(tag)) this.sections.set(tag, section);
    // Harmonic coordinates may have one more section, behind the others.
    this.isBegun ||= tag === (this.head?.system === 'harmonic' ? 'ELEM' : 'CTRI');
    const { residual } = this;
    if (tag === 'resi') this.residual = { ...section, header };
    if (tag !== 'FRAM') return null;
    this.residual = null;
    return { frames: { ...section, header }, residual };
  }

  private headBefore(offset: number): Head {
    if (this.head === null) throw damaged(offset, 'the section HEAD is missing');
    return this.head;
  }
}

/** What a section has that the model can be shown without. */
async function unlessDamaged<T>(section: Section, decode: () => T | Promise<T>): Promise<T | null> {
  try {
    return await decode();
  } catch (error) {
    if (!isTolerable(error, section.entry.fields.tag)) throw error;
    return null;
  }
}
