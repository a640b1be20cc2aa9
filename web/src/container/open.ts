/** Captures in containers that are read at random: what is asked for is read, decoded and kept for a while. */

import type { Capture, EditLayer, FrameBlock, FrameErrors, ModelSurface, StaticPart } from '../capture';
import { type Codec, createCodec } from '../codec/client';
import { computePhi } from '../coordinates/pool';
import { BlockCache } from './blockCache';
import { BlockDecoder, type CoordinatesOf } from './blocks';
import { ContainerError, damaged, isDamage, isTolerable } from './error';
import { checkHeadSection, type Head, parseHead } from './head';
import { checkSize, type Chunk, type Layout } from './layout';
import { decodePayload } from './codecs';
import { decodeLayer, withLayers, withoutErrors } from './layers';
import { decodeStatic, OPTIONAL_TAGS, type Section, STATIC_TAGS } from './meshes';
import { parsePictures, type Pictures } from './pictures';
import { readContents, readSections, scanSections } from './sectionReader';
import { checkPrelude, CODEC, type Entry, PRELUDE_BYTES, KNOWN_TAGS } from './section';
import { EndsCache, type Source } from './source';
import { decodeSurface } from './surface';
import { decodeErrors, decodeFrameNumbers, decodeReport, heldToBound, NO_ERRORS } from './tail';

/** Bytes at either end that are read at once: most of the static part of coded captures, and all that comes behind the frames of most. */
const FIRST_BYTES = 1 << 16;
const LAST_BYTES = 1 << 13;

export interface OpenOptions {
  readonly name?: string;
  /** Where coordinates in double precision come from, which coded cages need; by default they are computed where that is possible. */
  readonly coordinates?: CoordinatesOf;
  /** What decodes coded sections, closed with the capture; by default a worker. */
  readonly codec?: Codec;
  readonly signal?: AbortSignal;
}

export interface ContainerCapture extends Capture {
  readonly head: Head;
}

/**
 * Opens a container and decodes its model and cage. Of a file that was cut or damaged, the frames that are intact can be read where model and cage are, and
 * `problem` says what is wrong.
 *
 * @throws {ContainerError} where the file is no container, is of a later program, or has no intact model and cage.
 */
export async function openContainer(source: Source, options: OpenOptions = {}): Promise<ContainerCapture> {
  const { signal, name = 'capture.cager', coordinates = null } = options;
  const ends = await EndsCache.of(source, FIRST_BYTES, LAST_BYTES, signal);
  checkPrelude(await ends.read(0, Math.min(PRELUDE_BYTES, source.size), signal));
  const { layout, problem } = await readLayout(ends, signal);
  const head = await readHead(ends, layout, signal);
  layout.checkStatic(head);
  if (problem === null) layout.checkComplete(head);
  for (const entry of layout.entries) {
    const { tag } = entry.fields;
    if (KNOWN_TAGS.has(tag) && tag !== 'HEAD') checkSize(entry, head, layout.frames, source.size);
  }
  layout.checkLayers(source.size);
  const codec = options.codec ?? createCodec();
  try {
    const { part, problem: colorProblem } = await readStatic(ends, layout, head, codec, signal);
    const found = problem ?? colorProblem;
    const capture = new FileCapture(name, head, part, layout, ends, codec, coordinates, found);
    await capture.readTail(signal);
    return capture;
  } catch (error) {
    codec.close();
    throw error;
  }
}

/** The sections; of a damaged file those that can be found from the front, and what is wrong. */
async function readLayout(source: Source, signal?: AbortSignal): Promise<{ layout: Layout; problem: string | null }> {
  try {
    return { layout: await readContents(source, signal), problem: null };
  } catch (error) {
    if (!isDamage(error)) throw error;
    return { layout: await scanSections(source, signal), problem: error.message };
  }
}

export async function readHead(source: Source, layout: Layout, signal?: AbortSignal): Promise<Head> {
  const entry = layout.get('HEAD');
  if (entry === undefined) throw damaged(layout.end, 'the section HEAD is missing');
  checkHeadSection(entry);
  const [{ payload }] = await readSections(source, [entry], signal);
  return parseHead(decodePayload(entry, payload), entry.offset);
}

/** Model and cage; without colours and unit where one of them is damaged or of a later program, and what is wrong then. */
async function readStatic(
  source: Source,
  layout: Layout,
  head: Head,
  codec: Codec,
  signal?: AbortSignal,
): Promise<{ part: StaticPart; problem: string | null }> {
  const read = async (tags: readonly string[]): Promise<StaticPart> => {
    const entries = tags.map((tag) => layout.get(tag)).filter((entry) => entry !== undefined);
    entries.sort((a, b) => a.offset - b.offset);
    const sections = new Map<string, Section>();
    for (const section of await readSections(source, entries, signal)) sections.set(section.entry.fields.tag, section);
    return decodeStatic(head, sections, codec);
  };
  try {
    return { part: await read([...STATIC_TAGS, ...OPTIONAL_TAGS]), problem: null };
  } catch (error) {
    if (!OPTIONAL_TAGS.some((tag) => layout.get(tag) && isTolerable(error, tag))) throw error;
    return { part: await read(STATIC_TAGS), problem: (error as Error).message };
  }
}

class FileCapture implements ContainerCapture {
  static: StaticPart;
  readonly frames: number;
  readonly frameBytes: number;
  readonly complete = true;
  readonly events = new EventTarget();
  layers: readonly EditLayer[] = [];
  frameNumbers: Float64Array | null = null;
  private measured: FrameErrors = NO_ERRORS;
  /** The errors that still hold: those of frames without edits. */
  private held: FrameErrors | null = null;
  private readonly cache: BlockCache;
  private readonly blocks: BlockDecoder;

  constructor(
    readonly name: string,
    readonly head: Head,
    part: StaticPart,
    private readonly layout: Layout,
    private readonly source: Source,
    private readonly codec: Codec,
    coordinates: CoordinatesOf | null,
    public problem: string | null,
  ) {
    this.static = part;
    this.frames = layout.frames;
    this.frameBytes = layout.frameBytes;
    this.blocks = new BlockDecoder(part, codec, coordinates);
    this.cache = new BlockCache((first, signal) => this.load(first, signal));
  }

  async block(frame: number, signal?: AbortSignal): Promise<FrameBlock> {
    const chunk = frame >= 0 ? this.layout.chunkOf(frame) : undefined;
    if (chunk === undefined)
      throw new RangeError(`The capture has ${this.frames} frames, so there is no frame ${frame}.`);
    const { first, count } = chunk.frames.fields;
    const block = await this.cache.get(first, signal);
    // After the last comes the first one, as in a loop. Who reads here and there has no use for it.
    const next = first + count < this.frames ? first + count : 0;
    const before = this.layout.chunkOf(first > 0 ? first - 1 : this.frames - 1);
    if (next !== first && before && this.cache.has(before.frames.fields.first)) this.cache.prefetch(next);
    return withLayers(block, this.layers, this.static.rowsPerFrame);
  }

  get errors(): FrameErrors {
    return (this.held ??= withoutErrors(this.measured, this.layers));
  }

  setLayers(layers: readonly EditLayer[]): void {
    this.layers = layers;
    this.held = null;
    this.events.dispatchEvent(new Event('replaced'));
    this.events.dispatchEvent(new Event('change'));
  }

  phi(onProgress: (fraction: number) => void, signal: AbortSignal): Promise<Float32Array> {
    const isCoded = this.layout.chunks.some(({ frames }) => frames.fields.codec === CODEC.coded);
    return isCoded ? this.blocks.phi(onProgress, signal) : computePhi(this.static, { onProgress, signal });
  }

  /** Damage is told as {@link problem}: frames can be seen without it. */
  async surface(signal?: AbortSignal): Promise<ModelSurface | null> {
    let surface: ModelSurface | null = null;
    const take = async (section: Section) => {
      surface = await decodeSurface(section, this.head, this.static, this.codec);
    };
    await this.readOptional(this.layout.get('surf'), take, signal);
    return surface;
  }

  async pictures(signal?: AbortSignal): Promise<Pictures> {
    let pictures: Pictures = new Map();
    await this.readOptional(this.layout.get('pict'), (section) => (pictures = parsePictures(section)), signal);
    return pictures;
  }

  readTogether(frame: number): { readonly first: number; readonly count: number } {
    return this.layout.chunkOf(frame)?.frames.fields ?? { first: frame, count: 1 };
  }

  container(): Promise<Source> {
    return Promise.resolve(this.source);
  }

  close(): void {
    this.cache.clear();
    this.codec.close();
  }

  /** Reads errors, numbers, the report and edits; what of them is damaged is left out. */
  async readTail(signal?: AbortSignal): Promise<void> {
    const takeErrors = async (section: Section) => {
      this.measured = await decodeErrors(section, this.frames, this.codec);
    };
    const takeNumbers = (section: Section) => (this.frameNumbers = decodeFrameNumbers(section));
    const takeReport = (section: Section) => (this.static = { ...this.static, report: decodeReport(section) });
    const takeLayer = (section: Section) =>
      (this.layers = [...this.layers, decodeLayer(section, this.head, this.frames)]);
    await this.readOptional(this.layout.get('ERRS'), takeErrors, signal);
    await this.readOptional(this.layout.get('fnum'), takeNumbers, signal);
    await this.readOptional(this.layout.get('summ'), takeReport, signal);
    this.measured = heldToBound(this.measured, this.static.report);
    for (const entry of this.layout.layers) await this.readOptional(entry, takeLayer, signal);
  }

  private async readOptional(
    entry: Entry | undefined,
    take: (section: Section) => unknown,
    signal?: AbortSignal,
  ): Promise<void> {
    if (entry === undefined) return;
    try {
      const [section] = await readSections(this.source, [entry], signal);
      await take(section);
    } catch (error) {
      if (!isTolerable(error, entry.fields.tag)) throw error;
      this.report(error);
    }
  }

  private async load(first: number, signal: AbortSignal): Promise<FrameBlock> {
    const { frames, residual } = this.layout.chunkOf(first)!;
    try {
      const sections = await this.readChunk({ frames, residual }, signal);
      const { block, problem } = await this.blocks.decode(sections.frames, sections.residual, this.source.size, signal);
      if (problem !== null) this.report(problem);
      return block;
    } catch (error) {
      this.report(error);
      throw error;
    }
  }

  /** Reads the sections of a chunk; frames whose residual is damaged are read without it. */
  private async readChunk(
    { frames, residual }: Chunk,
    signal: AbortSignal,
  ): Promise<{ frames: Section; residual: Section | null }> {
    const read = async (entries: Entry[]) => readSections(this.source, entries, signal);
    if (residual === null) return { frames: (await read([frames]))[0], residual: null };
    try {
      const [first, second] = await read([residual, frames]);
      return { frames: second, residual: first };
    } catch (error) {
      if (!isDamage(error)) throw error;
      const [section] = await read([frames]);
      this.report(error);
      return { frames: section, residual: null };
    }
  }

  /** Keeps what is wrong with the container, for those who look. */
  private report(error: unknown): void {
    if (error instanceof ContainerError && this.problem === null) {
      this.problem = error.message;
      this.events.dispatchEvent(new Event('change'));
    }
  }
}
