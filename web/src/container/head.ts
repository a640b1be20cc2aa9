/** The section `HEAD`: what a decoder must know. */

import type { CoordinateSystem } from '../capture';
import { damaged, unknownFeature } from './error';
import { CODEC, type Entry, safeInteger, viewOf } from './section';

/** The definition of the coordinate systems that this reader knows. */
const DEFINITION = 3;
const SYSTEMS: readonly string[] = ['mvc', 'harmonic', 'green', 'green-free'] satisfies CoordinateSystem[];
const MAX_BYTES = 64 * 2 ** 10;
const MAX_COUNT = 2 ** 32 - 1;

export interface Head {
  readonly system: CoordinateSystem;
  readonly points: number;
  readonly restFaces: number;
  readonly restCorners: number;
  readonly cageVertices: number;
  readonly cageFaces: number;
  readonly rowsPerFrame: number;
  readonly frameRate: number | null;
}

/** Checks what the section of the header says before it is read. */
export function checkHeadSection({ fields, offset }: Entry): void {
  if (fields.codec !== CODEC.raw) throw damaged(offset, 'the header is compressed');
  if (fields.width !== 1 || fields.rawBytes > MAX_BYTES) throw damaged(offset, 'the header is too large');
}

/** Parses the raw content of `HEAD`, whose section begins at `offset`. */
export function parseHead(bytes: Uint8Array, offset: number): Head {
  const reader = new FieldReader(bytes, offset);
  const definition = reader.u32();
  const system = reader.text();
  reader.passHistory();
  const head = {
    points: reader.u64(),
    restFaces: reader.u64(),
    restCorners: reader.u64(),
    cageVertices: reader.u64(),
    cageFaces: reader.u64(),
    rowsPerFrame: reader.u32(),
    frameRate: reader.optionalF64(),
  };
  reader.end();
  if (head.frameRate !== null && !(Number.isFinite(head.frameRate) && head.frameRate > 0))
    throw damaged(offset, 'the frame rate is not a positive number');
  const impossible = head.rowsPerFrame === 0 || head.points > MAX_COUNT || head.cageVertices > MAX_COUNT;
  if (impossible || (head.restFaces === 0 && head.restCorners > 0))
    throw damaged(offset, 'the header has impossible counts');
  if (!isKnownSystem(system)) throw unknownFeature(`coordinates ${system}`);
  if (definition !== DEFINITION) throw unknownFeature(`coordinates of definition ${definition}`);
  const rows = head.cageVertices + (system === 'green-free' ? head.cageFaces : 0);
  if (head.rowsPerFrame !== rows)
    throw damaged(offset, `a frame has ${head.rowsPerFrame} rows where the cage has ${rows}`);
  return { ...head, system };
}

function isKnownSystem(name: string): name is CoordinateSystem {
  return SYSTEMS.includes(name);
}

class FieldReader {
  private readonly view: DataView;
  private at = 0;

  constructor(
    private readonly bytes: Uint8Array,
    private readonly offset: number,
  ) {
    this.view = viewOf(bytes);
  }

  u32(): number {
    return this.view.getUint32(this.advance(4), true);
  }

  u64(): number {
    return safeInteger(this.view, this.advance(8), this.offset);
  }

  f64(): number {
    return this.view.getFloat64(this.advance(8), true);
  }

  text(): string {
    const length = this.u64();
    const start = this.advance(length);
    try {
      return new TextDecoder('utf-8', { fatal: true, ignoreBOM: true }).decode(this.bytes.subarray(start, this.at));
    } catch {
      throw damaged(this.offset, 'the header cannot be read');
    }
  }

  /** Passes over how the cages were solved: handles, regulariser, spectrum and λ, which no decoder needs. */
  passHistory(): void {
    this.text();
    this.text();
    this.advance(4 + 8);
  }

  optionalF64(): number | null {
    const there = this.view.getUint8(this.advance(1));
    if (there > 1) throw damaged(this.offset, 'the header cannot be read');
    return there === 1 ? this.f64() : null;
  }

  end(): void {
    if (this.at !== this.bytes.length) throw damaged(this.offset, 'bytes are left over after the header');
  }

  private advance(length: number): number {
    const start = this.at;
    if (length > this.bytes.length - start) throw damaged(this.offset, 'the header is cut');
    this.at = start + length;
    return start;
  }
}
