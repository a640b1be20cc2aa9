import type { Capture, FrameBlock } from '../capture';
import { save } from '../save';
import { bodyOf } from '../service/answers';
import { addResidual } from '../codec/residual';
import { MAX_LAYERS } from '../container/layout';
import { type RewriteOptions, withEdits } from '../container/rewrite';
import { editedRows, type CageEdit } from './cageEdit';
import { framesOf, layersOf } from './editLayers';

export type ExportKind = 'container' | 'frames';

/** Why a capture cannot be saved as something, in a sentence; null where it can. */
export function obstacle(capture: Capture, kind: ExportKind): string | null {
  if (!capture.complete) return 'The capture is still running. Export it when it is complete.';
  if (kind === 'container' && !capture.container) return 'There is no .cager file of this capture.';
  if (kind === 'frames' && !capture.decode)
    return 'Frames are decoded by a service: open the capture as a session, or run cager decode on the exported file.';
  return null;
}

export async function exportEdited(
  capture: Capture,
  edits: readonly CageEdit[],
  kind: ExportKind,
  name: string,
  options: { readonly signal: AbortSignal; readonly onProgress: (fraction: number) => void },
): Promise<void> {
  if (kind === 'frames') {
    save(await decodedFrames(capture, edits, options), `${name}-edited.npy`);
    return;
  }
  save(await withNewEdits(capture, edits, options), `${name}-edited.cager`);
}

/**
 * The container of a capture with its layers as they are now, and a new one for each edit: all that was encoded stays as it is, byte for byte.
 *
 * @throws {ContainerError} where the container is damaged
 */
export async function withNewEdits(
  capture: Capture,
  edits: readonly CageEdit[],
  options: RewriteOptions = {},
): Promise<Blob> {
  const { signal, onProgress } = options;
  const part = (share: number, from: number) => (fraction: number) => onProgress?.(from + share * fraction);
  const added = await layersOf(capture, edits, { ...options, onProgress: part(0.5, 0) });
  const layers = [...(capture.layers ?? []), ...added];
  if (layers.length > MAX_LAYERS)
    throw new Error(`A file has at most ${MAX_LAYERS} edits, and these would be ${layers.length}; remove some.`);
  return withEdits(await capture.container!(signal), layers, { ...options, onProgress: part(0.5, 0.5) });
}

/** Bytes of cages in one request, and of positions in its answer; services limit what they take at once. */
const REQUEST_BYTES = 4 * 2 ** 20;

/**
 * All frames with their edits as positions in a NumPy file, frames × points × 3 in single precision: cages are decoded by the service, and what is coded beside them is
 * added here.
 *
 * @param onProgress hears the part that has arrived, 0 to 1
 * @throws ServiceProblem where the service refuses; its message is a sentence to show
 */
export async function decodedFrames(
  capture: Capture,
  edits: readonly CageEdit[],
  { signal, onProgress }: RewriteOptions = {},
): Promise<Blob> {
  const { frames } = capture;
  const { rest, rowsPerFrame } = capture.static;
  const { length } = rest;
  // Blobs may leave memory; arrays of all frames would not.
  const pieces: Blob[] = [new Blob([npyHeader([frames, length / 3, 3])])];
  let batch: { readonly block: FrameBlock; readonly frame: number; readonly rows: Float32Array }[] = [];
  const decode = async () => {
    const cages = new Float32Array(batch.length * 3 * rowsPerFrame);
    batch.forEach(({ rows }, k) => cages.set(rows, k * 3 * rowsPerFrame));
    const answer = await bodyOf(await capture.decode!(new Blob([cages]), signal), signal);
    if (answer.byteLength !== 4 * length * batch.length)
      throw new Error('The service sent too few frames. Export again.');
    const positions = new Float32Array(answer);
    batch.forEach(({ block, frame }, k) => {
      if (block.residual)
        addResidual(block.residual, frame - block.first, positions.subarray(k * length, (k + 1) * length));
    });
    pieces.push(new Blob([positions]));
    onProgress?.((batch.at(-1)!.frame + 1) / frames);
    batch = [];
  };
  const most = Math.max(1, Math.floor(REQUEST_BYTES / (12 * Math.max(rowsPerFrame, length / 3))));
  for await (const { frame, block, rows } of framesOf(capture, 0, frames, signal)) {
    batch.push({ block, frame, rows: editedRows(rows, frame, edits) });
    if (batch.length === most) await decode();
  }
  if (batch.length > 0) await decode();
  return new Blob(pieces, { type: 'application/octet-stream' });
}

/** What a NumPy file of little-endian floats in C order begins with (format version 1.0). */
export function npyHeader(shape: readonly number[]): Uint8Array<ArrayBuffer> {
  const text = `{'descr': '<f4', 'fortran_order': False, 'shape': (${shape.join(', ')}), }`;
  // With the ten bytes before it, the header ends with a line break at a multiple of 64.
  const length = Math.ceil((text.length + 11) / 64) * 64 - 10;
  const bytes = new Uint8Array(10 + length).fill(0x20);
  bytes.set([0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0, length & 0xff, length >> 8]);
  bytes.set(new TextEncoder().encode(text), 10);
  bytes[bytes.length - 1] = 0x0a;
  return bytes;
}
