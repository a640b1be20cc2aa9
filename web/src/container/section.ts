/** Prelude, section headers and footer: everything of fixed size; docs/FORMAT.md. */

import { crc32c } from './crc32c';
import { damaged, newerVersion, notAContainer, unknownFeature } from './error';

export const PRELUDE_BYTES = 16;
export const HEADER_BYTES = 40;
export const FOOTER_BYTES = 24;
/** Bytes of an entry of the table of contents: an offset, and a section's header without its checksums. */
export const ENTRY_BYTES = 40;

export const MAGIC = [0x89, 0x43, 0x47, 0x52, 0x0d, 0x0a, 0x1a, 0x0a];
export const FOOTER_MAGIC = [0x43, 0x47, 0x52, 0x45];

/** Numbers of the codecs. `coded` are groups of frames, `codedStatic` meshes at rest and errors of frames. */
export const CODEC = { raw: 0, planes: 1, difference: 2, coded: 3, codedStatic: 4 } as const;

/** Whether a section is whole numbers. */
export function isCoded(codec: number): boolean {
  return codec === CODEC.coded || codec === CODEC.codedStatic;
}

/** The fields that a section's header and its entry in the table of contents share. */
export interface SectionFields {
  readonly tag: string;
  readonly codec: number;
  readonly width: number;
  readonly first: number;
  readonly count: number;
  readonly payloadBytes: number;
  readonly rawBytes: number;
}

export interface SectionHeader extends SectionFields {
  readonly payloadCrc: number;
}

/** A section and where its header begins. */
export interface Entry {
  readonly offset: number;
  readonly fields: SectionFields;
}

/** Checks the first bytes of a file; fewer than a prelude has are those of a file that was cut, or of another one. */
export function checkPrelude(bytes: Uint8Array): void {
  if (bytes.length === 0 || !startsWith(bytes, MAGIC.slice(0, bytes.length))) throw notAContainer();
  if (bytes.length < PRELUDE_BYTES) throw damaged(bytes.length, 'the file was cut');
  const view = viewOf(bytes);
  if (crc32c(bytes.subarray(0, 12)) !== view.getUint32(12, true))
    throw damaged(0, 'the checksum of the first bytes does not match');
  const version = view.getUint16(8, true);
  if (version !== 1) throw newerVersion(version);
  if (view.getUint16(10, true) !== 0) throw unknownFeature('flags');
}

/** Reads the header of a section that begins at `offset`. */
export function parseHeader(bytes: Uint8Array, offset: number): SectionHeader {
  const view = viewOf(bytes);
  if (crc32c(bytes.subarray(0, 36)) !== view.getUint32(36, true))
    throw damaged(offset, "the checksum of a section's header does not match");
  if (view.getUint16(6, true) !== 0) throw damaged(offset + 6, 'reserved bytes are not zero');
  return { ...parseFields(bytes, offset), payloadCrc: view.getUint32(32, true) };
}

/** Reads bytes 0 to 31 of a section's header. */
export function parseFields(bytes: Uint8Array, offset: number): SectionFields {
  const view = viewOf(bytes);
  return {
    tag: String.fromCharCode(...bytes.subarray(0, 4)),
    codec: bytes[4],
    width: bytes[5],
    first: view.getUint32(8, true),
    count: view.getUint32(12, true),
    payloadBytes: safeInteger(view, 16, offset),
    rawBytes: safeInteger(view, 24, offset),
  };
}

/** Checks the last bytes of a file of this length; returns the offset of the table of contents. */
export function checkFooter(bytes: Uint8Array, fileBytes: number): number {
  const offset = fileBytes - FOOTER_BYTES;
  const view = viewOf(bytes);
  if (!startsWith(bytes.subarray(16), FOOTER_MAGIC))
    throw damaged(offset, 'the end is missing, as of a file that was cut');
  if (crc32c(bytes.subarray(0, 20)) !== view.getUint32(20, true) || safeInteger(view, 8, offset) !== fileBytes)
    throw damaged(offset, 'the end does not fit the file');
  return safeInteger(view, 0, offset);
}

export function sameFields(a: SectionFields, b: SectionFields): boolean {
  return (Object.keys(b) as (keyof SectionFields)[]).every((name) => a[name] === b[name]);
}

export function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** A u64 that is a length or a count: none that memory or a file could have is beyond what a number holds exactly. */
export function safeInteger(view: DataView, at: number, offset: number): number {
  const number = view.getBigUint64(at, true);
  if (number > BigInt(Number.MAX_SAFE_INTEGER)) throw damaged(offset, 'a length or count is impossible');
  return Number(number);
}

function startsWith(bytes: Uint8Array, start: readonly number[]): boolean {
  return start.every((byte, k) => bytes[k] === byte);
}

export const KNOWN_TAGS: ReadonlySet<string> = new Set(
  'HEAD ORIG unit RPTS RFAC rcol surf pict COMP CVTX CTRI ELEM FRAM resi ERRS fnum summ EDIT TOC_'.split(' '),
);

/** Whether a reader that does not know the section must refuse the file. */
export function isRequired(tag: string): boolean {
  return !/^[a-z]/.test(tag);
}
