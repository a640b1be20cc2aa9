import type { Capture, FrameErrors, StaticPart } from '../capture';
import { type Codec, createCodec } from '../codec/client';
import { damaged } from '../container/error';
import type { Section } from '../container/meshes';
import { readContents, readSections } from '../container/sectionReader';
import type { Source } from '../container/source';
import { decodeErrors, decodeReport } from '../container/tail';
import { ContainerWriter } from '../container/writer';
import { editedBlock, type CageEdit } from './cageEdit';

/** Sections that hold whatever the cages are; they are taken over as they are. */
const KEPT_BEFORE = ['HEAD', 'ORIG', 'unit', 'RPTS', 'RFAC', 'rcol', 'CVTX', 'CTRI', 'ELEM'];
const CHUNK_FRAMES = 16;
/** As `cager edit` writes it. */
const NOT_MEASURED = 'the cages were edited: their errors are not measured';

export interface WrittenContainer {
  readonly container: Blob;
  readonly changed: number;
}

export interface EditedOptions {
  readonly signal?: AbortSignal;
  /** Hears the part that is done, 0 to 1. */
  readonly onProgress?: (fraction: number) => void;
  /** What decodes coded errors, closed after that; by default a worker. */
  readonly codec?: Codec;
}

/**
 * Writes a container again with edited cages, by the rules of `cager edit`: model, cage and numbers of frames are taken over, frames are stored as they are,
 * a residual is left out since it belongs to the cages as they were, and errors that no longer hold become NaN.
 *
 * @param source the container that holds `capture`'s frames
 * @throws {ContainerError} where the container is damaged
 */
export async function writeEdited(
  source: Source,
  capture: Pick<Capture, 'block'> & { readonly static: Pick<StaticPart, 'rowsPerFrame'> },
  edits: readonly CageEdit[],
  { signal, onProgress, codec }: EditedOptions = {},
): Promise<WrittenContainer> {
  const layout = await readContents(source, signal);
  const read = async (tag: string) => {
    // The page passes over units and lists them among all alone.
    const entry = layout.get(tag) ?? layout.entries.find(({ fields }) => fields.tag === tag);
    return entry === undefined ? null : (await readSections(source, [entry], signal))[0];
  };
  const writer = new ContainerWriter();
  const copy = async (tag: string) => {
    const section = await read(tag);
    if (section) writer.add(section.entry.fields, section.payload.slice());
  };
  for (const tag of KEPT_BEFORE) await copy(tag);

  const { frames } = layout;
  const known = await read('ERRS');
  if (!known) throw damaged(layout.end, 'the section ERRS is missing');
  const { l2, linf } = await errorsOf(known, frames, codec);
  const losesResidual = layout.chunks.some(({ residual }) => residual !== null);
  const errors = new Float32Array(2 * frames);
  let changed = 0;
  for await (const { first, count, rows, isChanged } of chunksOf(capture, frames, edits, signal)) {
    for (let k = 0; k < count; k++) {
      const isKnown = !isChanged[k] && !losesResidual;
      errors.set(isKnown ? [l2[first + k], linf[first + k]] : [NaN, NaN], 2 * (first + k));
      changed += isChanged[k] ? 1 : 0;
    }
    writer.add({ tag: 'FRAM', width: 4, first, count }, bytesOf(rows));
    onProgress?.((first + count) / frames);
  }
  writer.add({ tag: 'ERRS', width: 4 }, bytesOf(errors));
  await copy('fnum');
  const summary = await read('summ');
  if (summary) {
    const report = reportAfter(decodeReport(summary), changed > 0 || losesResidual);
    writer.add({ tag: 'summ' }, new TextEncoder().encode(JSON.stringify(report)));
  }
  return { container: writer.finish(), changed };
}

async function errorsOf(section: Section, frames: number, codec: Codec = createCodec()): Promise<FrameErrors> {
  try {
    return await decodeErrors(section, frames, codec);
  } finally {
    codec.close();
  }
}

interface Chunk {
  readonly first: number;
  readonly count: number;
  /** `count × rowsPerFrame × 3`. */
  readonly rows: Float32Array<ArrayBuffer>;
  readonly isChanged: readonly boolean[];
}

/** All frames with their edits, in chunks of {@link CHUNK_FRAMES}. */
export async function* chunksOf(
  capture: Pick<Capture, 'block'> & { readonly static: Pick<StaticPart, 'rowsPerFrame'> },
  frames: number,
  edits: readonly CageEdit[],
  signal?: AbortSignal,
  chunkFrames = CHUNK_FRAMES,
): AsyncGenerator<Chunk> {
  const width = 3 * capture.static.rowsPerFrame;
  for (let first = 0; first < frames; first += chunkFrames) {
    const count = Math.min(chunkFrames, frames - first);
    const rows = new Float32Array(count * width);
    const isChanged: boolean[] = [];
    for (let k = 0; k < count;) {
      const block = await capture.block(first + k, signal);
      const edited = editedBlock(block, edits, capture.static);
      const skipped = first + k - block.first;
      const taken = Math.min(count - k, block.count - skipped);
      if (skipped < 0 || taken <= 0)
        throw new Error(`Frame ${first + k} is not where the capture says; load it again.`);
      for (let frame = skipped; frame < skipped + taken; frame++, k++) {
        const own = edited.cages.subarray(frame * width, (frame + 1) * width);
        if (!own.every(Number.isFinite))
          throw new Error(`A vertex of frame ${block.first + frame} is too far away to be stored; move it closer.`);
        rows.set(own, k * width);
        const before = block.cages.subarray(frame * width, (frame + 1) * width);
        isChanged.push(own.some((x, at) => x !== before[at]));
      }
    }
    yield { first, count, rows, isChanged };
  }
}

/** The parts of the report that still hold: frames are no longer coded, and what was measured of them is only known if none has changed. */
function reportAfter(report: Readonly<Record<string, unknown>>, isChanged: boolean): Record<string, unknown> {
  const kept: Record<string, unknown> = { ...report };
  delete kept.coding;
  if (!isChanged) return kept;
  const warnings = Array.isArray(report.warnings) ? (report.warnings as unknown[]) : [];
  return {
    ...kept,
    error: { l2_mean: null, l2_max: null, linf_mean: null, linf_max: null, kg_percent: null },
    warnings: [...warnings.filter((warning) => warning !== NOT_MEASURED), NOT_MEASURED],
  };
}

function bytesOf(numbers: Float32Array<ArrayBuffer>): Uint8Array<ArrayBuffer> {
  return new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
}
