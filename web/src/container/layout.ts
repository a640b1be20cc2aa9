/** Which sections a container has, and the checks of their order, number and sizes; docs/FORMAT.md, "What a reader must check". */

import { damaged, unknownFeature } from './error';
import type { Head } from './head';
import {
  CODEC,
  type Entry,
  HEADER_BYTES,
  isCoded,
  PRELUDE_BYTES,
  type SectionFields,
  KNOWN_TAGS,
  isRequired,
} from './section';

const MAX_FRAMES = 2 ** 32 - 1;
export const MAX_LAYERS = 256;
const MIB = 2 ** 20;

/** A chunk of frames, and the residual right before it. */
export interface Chunk {
  readonly frames: Entry;
  readonly residual: Entry | null;
}

/** Sections as they follow each other in a file. */
export class Layout {
  readonly chunks: Chunk[] = [];
  readonly entries: Entry[] = [];
  /** Layers of edits. */
  readonly layers: Entry[] = [];
  private readonly byTag = new Map<string, Entry>();
  private pendingResidual: Entry | null = null;
  /** Where the next section begins. */
  end = PRELUDE_BYTES;

  get frames(): number {
    const last = this.chunks.at(-1)?.frames.fields;
    return last === undefined ? 0 : last.first + last.count;
  }

  /** Checks that all edits together take no more than one section may in a file of so many bytes. */
  checkLayers(fileBytes: number): void {
    const bytes = this.layers.reduce((sum, { fields }) => sum + fields.rawBytes, 0);
    if (bytes > mostRawBytes({ tag: 'EDIT', codec: CODEC.raw }, fileBytes))
      throw damaged(this.layers[0].offset, 'the edits declare more bytes than the file can hold');
  }

  /** Bytes of the sections of all frames and their residuals. */
  get frameBytes(): number {
    let bytes = 0;
    for (const { frames, residual } of this.chunks) {
      bytes += HEADER_BYTES + frames.fields.payloadBytes;
      if (residual !== null) bytes += HEADER_BYTES + residual.fields.payloadBytes;
    }
    return bytes;
  }

  get(tag: string): Entry | undefined {
    return this.byTag.get(tag);
  }

  add(entry: Entry): void {
    const { tag, first, count, codec } = entry.fields;
    if (!KNOWN_TAGS.has(tag) && isRequired(tag)) throw unknownFeature(tag);
    if (tag === 'TOC_') throw damaged(entry.offset, 'the table of contents is not at the end');
    const residual = this.pendingResidual;
    const follows = tag === 'FRAM' && residual?.fields.first === first && residual.fields.count === count;
    if ((residual !== null && !follows) || (tag === 'resi' && codec !== CODEC.coded))
      throw damaged(entry.offset, 'a residual is not followed by its frames');
    this.pendingResidual = tag === 'resi' ? entry : null;
    if (tag === 'FRAM') {
      if (first !== this.frames || count === 0 || first + count > MAX_FRAMES)
        throw damaged(entry.offset, 'the frames are not in order');
      this.chunks.push({ frames: entry, residual });
    } else if (tag === 'EDIT') {
      if (this.layers.push(entry) > MAX_LAYERS) throw damaged(entry.offset, `there are more than ${MAX_LAYERS} edits`);
    } else if (tag !== 'resi' && KNOWN_TAGS.has(tag)) {
      if (this.byTag.has(tag)) throw damaged(entry.offset, `the section ${tag} is there twice`);
      this.byTag.set(tag, entry);
    }
    this.entries.push(entry);
    this.end = entry.offset + HEADER_BYTES + entry.fields.payloadBytes;
  }

  /** Checks that all sections of a whole file are there. */
  checkComplete(head: Head): void {
    this.checkStatic(head);
    if (this.pendingResidual !== null)
      throw damaged(this.pendingResidual.offset, 'a residual is not followed by its frames');
    if (!this.byTag.has('ERRS')) throw damaged(this.end, 'the section ERRS is missing');
  }

  /** Checks that the sections of model and cage are there. */
  checkStatic(head: Head): void {
    for (const tag of ['RPTS', 'CVTX', 'CTRI', ...(head.restFaces > 0 ? ['RFAC'] : [])]) {
      if (!this.byTag.has(tag)) throw damaged(this.end, `the section ${tag} is missing`);
    }
    const unexpected = head.restFaces === 0 ? this.byTag.get('RFAC') : undefined;
    if (unexpected !== undefined) throw damaged(unexpected.offset, 'the section RFAC is there without faces');
    const elements = this.byTag.get('ELEM');
    if (elements !== undefined && head.system !== 'harmonic')
      throw damaged(elements.offset, `coordinates ${head.system} have no boundary elements`);
    const components = this.byTag.get('COMP');
    if (components !== undefined && head.system !== 'mvc')
      throw damaged(components.offset, `coordinates ${head.system} of a cage by component`);
  }

  chunkOf(frame: number): Chunk | undefined {
    let [low, high] = [0, this.chunks.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      const { first, count } = this.chunks[middle].frames.fields;
      if (first + count <= frame) low = middle + 1;
      else high = middle;
    }
    return this.chunks.at(low);
  }
}

/**
 * Checks that a section has the width of the format, and the size that the header's counts and this number of frames give it, within the limit for a file of so
 * many bytes.
 */
export function checkSize(entry: Entry, head: Head, frames: number, fileBytes: number): void {
  const { fields, offset } = entry;
  const [widths, expected] = expectedSize(fields, head, frames);
  if (!widths.includes(fields.width) || fields.rawBytes !== expected)
    throw damaged(offset, 'a section does not have the size that the header gives it');
  if (fields.rawBytes > mostRawBytes(fields, fileBytes))
    throw damaged(offset, 'a section declares more bytes than the file can hold');
}

/** Most bytes that a section may decode to in a file of so many bytes. */
function mostRawBytes({ tag, codec }: Pick<SectionFields, 'tag' | 'codec'>, fileBytes: number): number {
  if (tag === 'summ') return 4 * MIB + 16 * fileBytes;
  if (tag === 'EDIT') return 8 * MIB + 16 * fileBytes;
  return isCoded(codec) ? 2 * MIB + 16 * fileBytes : 12 * MIB + 48 * fileBytes;
}

/** Most numbers of a residual's components in a file of so many bytes. */
export function mostResidualNumbers(fileBytes: number): number {
  return 64 * MIB + 64 * fileBytes;
}

/** Widths that a section may have, and its raw bytes. */
function expectedSize(fields: SectionFields, head: Head, frames: number): [readonly number[], number] {
  switch (fields.tag) {
    case 'RPTS':
      return [[4, 8], 3 * fields.width * head.points];
    case 'CVTX':
      return [[4, 8], 3 * fields.width * head.cageVertices];
    case 'RFAC':
      return [[4], 4 * (head.restFaces + head.restCorners)];
    case 'ORIG':
      return [[8], 24];
    case 'unit':
      return [[1], 9];
    case 'rcol':
      return [[1], 3 * head.points];
    // What else it is to be is checked when it is decoded.
    case 'EDIT':
    case 'COMP':
      return [[4], fields.rawBytes];
    case 'CTRI':
      return [[4], 12 * head.cageFaces];
    case 'FRAM':
      return [[4], 12 * fields.count * head.rowsPerFrame];
    case 'ERRS':
      return [[4], 8 * frames];
    case 'fnum':
      return [[8], 8 * frames];
    default:
      return [[1], fields.rawBytes];
  }
}
