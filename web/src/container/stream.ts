/** Model and cage of a container that is read from front to back while it arrives, as that of a session that is still running. */

import type { StaticPart } from '../capture';
import type { Codec } from '../codec/client';
import { decodePayload } from './codecs';
import { checksumDamage, damaged, isTolerable } from './error';
import { checkHeadSection, type Head, parseHead } from './head';
import { checkSize } from './layout';
import { decodeStatic, type Section, STATIC_TAGS } from './meshes';
import type { Entry } from './section';
import { type Arrival, SectionParser } from './sectionParser';
import { KNOWN_TAGS } from './tag';

/** Takes a container in pieces of any size until model and cage are whole. */
export class StaticStream {
  private readonly parser = new SectionParser();
  private readonly sections = new Map<string, Section>();
  private head: Head | null = null;
  private colors: Uint8Array | null = null;

  constructor(private readonly codec: Codec) {}

  /**
   * Takes a piece; gives model and cage once they are whole. Colours that are damaged, or come later, are left out.
   *
   * @throws {ContainerError} where the bytes are no container, need a later program, or model or cage are damaged
   */
  async push(piece: Uint8Array): Promise<StaticPart | null> {
    this.parser.append(piece);
    for (let arrival = this.parser.next(); arrival !== null; arrival = this.parser.next()) {
      if (this.isWholeAfter(arrival)) {
        const { layout } = this.parser;
        const head = this.headBefore(layout.end);
        layout.checkStatic(head);
        const part = await decodeStatic(head, this.sections, this.codec);
        return this.colors === null ? part : { ...part, colors: this.colors };
      }
    }
    return null;
  }

  private isWholeAfter(arrival: Arrival): boolean {
    switch (arrival.kind) {
      case 'header':
        return this.check(arrival.entry);
      case 'section':
        return this.take(arrival.section, arrival.isIntact);
      default:
        return true;
    }
  }

  /** Checks what a section says before its payload is waited for; whether it can only come behind model and cage. */
  private check(entry: Entry): boolean {
    const { tag } = entry.fields;
    const { layout } = this.parser;
    if (tag === 'HEAD') {
      checkHeadSection(entry);
      return false;
    }
    if (!KNOWN_TAGS.has(tag)) {
      return false;
    }
    checkSize(entry, this.headBefore(entry.offset), layout.frames, layout.end);
    // Colours may be among the sections of the static part, or anywhere else.
    return !STATIC_TAGS.includes(tag) && tag !== 'rcol';
  }

  /** Takes a section; whether it is the last one of model and cage. */
  private take(section: Section, isIntact: boolean): boolean {
    const { entry, payload } = section;
    const { tag } = entry.fields;
    try {
      if (!isIntact) {
        throw checksumDamage(entry.offset);
      }
      if (tag === 'rcol') {
        this.colors = decodePayload(entry, payload);
      } else if (tag === 'HEAD') {
        this.head = parseHead(decodePayload(entry, payload), entry.offset);
      } else {
        this.sections.set(tag, section);
      }
    } catch (error) {
      if (tag !== 'rcol' || !isTolerable(error, tag)) {
        throw error;
      }
    }
    // Harmonic coordinates may have one more section, behind the others.
    return tag === (this.head?.system === 'harmonic' ? 'ELEM' : 'CTRI');
  }

  private headBefore(offset: number): Head {
    if (this.head === null) {
      throw damaged(offset, 'the section HEAD is missing');
    }
    return this.head;
  }
}
