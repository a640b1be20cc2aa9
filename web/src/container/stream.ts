/** Containers that are read from front to back while they arrive, such as that of a session that is still running. */

import type { FrameBlock, FrameErrors, StaticPart } from '../capture';
import { type Codec, createCodec } from '../codec/client';
import { BlockDecoder, type CoordinatesOf } from './blocks';
import { decodePayload } from './codecs';
import { checksumDamage, damaged, isDamage, isTolerable } from './error';
import { checkHeadSection, type Head, parseHead } from './head';
import { checkSize } from './layout';
import { decodeStatic, type Section, STATIC_TAGS } from './meshes';
import { type Entry } from './section';
import { type Arrival, SectionParser } from './sectionParser';
import { decodeErrors, decodeFrameNumbers, decodeReport, NO_ERRORS } from './tail';
import { isRequired, KNOWN_TAGS } from './tag';

export interface StreamOptions {
  /** As in `OpenOptions`. */
  readonly coordinates?: CoordinatesOf;
  readonly codec?: Codec;
  /** Length of the whole container, where it is known. */
  readonly size?: number;
  /** Called once, as soon as model and cage are whole. */
  readonly onStatic: (part: StaticPart) => void;
  /** Called for each block that is intact, in the order of the frames. */
  readonly onBlock: (block: FrameBlock) => void;
}

/** What is known at the end. */
export interface StreamEnd {
  /** Whether the container came to its end. */
  readonly complete: boolean;
  /** What is wrong with it: the first damage found, or that it was cut. */
  readonly problem: string | null;
  /** Frames whose blocks began, damaged ones included. */
  readonly frames: number;
  readonly errors: FrameErrors;
  readonly frameNumbers: Float64Array | null;
  readonly report: Readonly<Record<string, unknown>> | null;
}

/**
 * Decodes a container that is pushed in pieces of any size. A section whose payload is damaged is passed over where frames can do without it; behind a
 * damaged header nothing can be found.
 */
export class ContainerStream {
  private readonly parser = new SectionParser();
  private readonly statics = new Map<string, Section>();
  private codec: Codec | null = null;
  private head: Head | null = null;
  private part: StaticPart | null = null;
  private blocks: BlockDecoder | null = null;
  private residual: Section | null = null;
  private errors = NO_ERRORS;
  private frameNumbers: Float64Array | null = null;
  private report: StaticPart['report'] = null;
  private colors: Uint8Array | null = null;
  private problem: string | null = null;
  private isStopped = false;
  private work: Promise<void> = Promise.resolve();

  constructor(private readonly options: StreamOptions) {}

  /**
   * Takes a piece; resolves when what it completed is decoded. Whoever waits for that before the next piece keeps little in memory.
   *
   * @throws {ContainerError} where the bytes are no container, need a later program, or model or cage are damaged. Pushing on is in vain then.
   */
  push(piece: Uint8Array): Promise<void> {
    this.parser.append(piece);
    this.work = this.work.then(() => this.drain());
    return this.work;
  }

  /**
   * To be called when no more bytes come.
   *
   * @throws {ContainerError} as {@link push}, and where the container ended before model and cage were whole.
   */
  async finish(): Promise<StreamEnd> {
    await this.work;
    this.parser.checkBeginning();
    await this.emitStatic();
    const complete = this.parser.isAtEnd;
    if (!complete) {
      this.note(damaged(this.parser.received, 'the file was cut'));
    }
    const { problem, errors, frameNumbers, report } = this;
    return { complete, problem, frames: this.parser.layout.frames, errors, frameNumbers, report };
  }

  /** Ends the codec. */
  close(): void {
    this.codec?.close();
  }

  /** Handles all that arrived. */
  private async drain(): Promise<void> {
    if (!this.isStopped) {
      try {
        for (let arrival = this.parser.next(); arrival !== null; arrival = this.parser.next()) {
          await this.handle(arrival);
        }
      } catch (error) {
        this.isStopped = true;
        // What came before can be looked at.
        if (!isDamage(error) || this.part === null) {
          throw error;
        }
        this.note(error);
      }
    }
    if (this.parser.isAtEnd && this.parser.waiting > 0) {
      this.note(damaged(this.parser.layout.end, 'there are bytes after the end'));
    }
    if (this.parser.isAtEnd || this.isStopped) {
      this.parser.clear();
    }
  }

  private async handle(arrival: Arrival): Promise<void> {
    switch (arrival.kind) {
      case 'header':
        return this.begin(arrival.entry);
      case 'section':
        return this.take(arrival.section, arrival.isIntact);
      case 'unknown':
        if (!arrival.isIntact) {
          this.note(checksumDamage(arrival.entry.offset));
        }
        return;
      case 'end':
        this.parser.layout.checkComplete(this.headBefore(this.parser.layout.end));
    }
  }

  /** Checks what a section says before its payload is waited for. */
  private async begin(entry: Entry): Promise<void> {
    const { tag } = entry.fields;
    if (tag === 'HEAD') {
      checkHeadSection(entry);
    } else if (KNOWN_TAGS.has(tag)) {
      checkSize(entry, this.headBefore(entry.offset), this.parser.layout.frames, this.fileBytes());
      // Colours may be among the sections of the static part, or anywhere else.
      if (!STATIC_TAGS.includes(tag) && tag !== 'rcol') {
        await this.emitStatic();
      }
    }
  }

  private async take(section: Section, isIntact: boolean): Promise<void> {
    const { tag } = section.entry.fields;
    try {
      if (!isIntact) {
        throw checksumDamage(section.entry.offset);
      }
      await (tag === 'HEAD' || STATIC_TAGS.includes(tag) ? this.takeStatic(section) : this.takeOther(section));
    } catch (error) {
      if (!isTolerable(error, tag) || (this.part === null && isRequired(tag))) {
        throw error;
      }
      this.note(error as Error);
    }
  }

  private async takeStatic(section: Section): Promise<void> {
    const { entry, payload } = section;
    if (entry.fields.tag === 'HEAD') {
      this.head = parseHead(decodePayload(entry, payload), entry.offset);
      return;
    }
    this.statics.set(entry.fields.tag, section);
    // Harmonic coordinates may have one more section, behind the others.
    const last = this.headBefore(entry.offset).system === 'harmonic' ? 'ELEM' : 'CTRI';
    if (entry.fields.tag === last) {
      await this.emitStatic();
    }
  }

  /** Decodes model and cage and hands them out, once. */
  private async emitStatic(): Promise<void> {
    if (this.part !== null) {
      return;
    }
    const { layout } = this.parser;
    const head = this.headBefore(layout.end);
    layout.checkStatic(head);
    const missing = STATIC_TAGS.find((tag) => layout.get(tag) !== undefined && !this.statics.has(tag));
    if (missing !== undefined) {
      throw damaged(layout.end, `the section ${missing} was cut`);
    }
    this.codec ??= this.options.codec ?? createCodec();
    const part = await decodeStatic(head, this.statics, this.codec);
    this.part = this.colors === null ? part : { ...part, colors: this.colors };
    this.statics.clear();
    this.blocks = new BlockDecoder(this.part, this.codec, this.options.coordinates ?? null);
    this.options.onStatic(this.part);
  }

  /** Takes an intact section that is not needed for the static part. */
  private async takeOther(section: Section): Promise<void> {
    const { tag, first } = section.entry.fields;
    if (tag === 'resi') {
      this.residual = section;
    } else if (tag === 'FRAM') {
      const residual = this.residual?.entry.fields.first === first ? this.residual : null;
      this.residual = null;
      const { block, problem } = await this.blocks!.decode(section, residual, this.fileBytes());
      this.options.onBlock(block);
      if (problem !== null) {
        this.note(problem);
      }
    } else if (tag === 'ERRS') {
      this.codec ??= this.options.codec ?? createCodec();
      this.errors = await decodeErrors(section, this.parser.layout.frames, this.codec);
    } else if (tag === 'fnum') {
      this.frameNumbers = decodeFrameNumbers(section);
    } else if (tag === 'rcol') {
      this.colors = decodePayload(section.entry, section.payload);
    } else {
      this.report = decodeReport(section);
    }
  }

  /** Length of the container as far as it is known: limits grow with it. */
  private fileBytes(): number {
    return Math.max(this.options.size ?? 0, this.parser.layout.end);
  }

  private headBefore(offset: number): Head {
    if (this.head === null) {
      throw damaged(offset, 'the section HEAD is missing');
    }
    return this.head;
  }

  /** Keeps what is wrong first. */
  private note(damage: Error): void {
    this.problem ??= damage.message;
  }
}
