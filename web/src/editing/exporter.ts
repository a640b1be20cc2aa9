import type { Capture } from '../capture';
import { save } from '../save';
import type { CageEdit } from './cageEdit';
import { writeEdited, chunksOf } from './editedContainer';

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
  const source = await capture.container!(options.signal);
  const { container } = await writeEdited(source, capture, edits, options);
  save(container, `${name}-edited.cager`);
}

/** Bytes of cages in one request; services limit what they take at once. */
const REQUEST_BYTES = 4 * 2 ** 20;

/**
 * All frames with their edits as positions, decoded by the service, in a NumPy file: frames × points × 3 in single precision.
 *
 * @param onProgress hears the part that has arrived, 0 to 1
 * @throws ServiceProblem where the service refuses; its message is a sentence to show
 */
export async function decodedFrames(
  capture: Capture,
  edits: readonly CageEdit[],
  { signal, onProgress }: { signal?: AbortSignal; onProgress?: (fraction: number) => void } = {},
): Promise<Blob> {
  const { frames } = capture;
  const { rest, rowsPerFrame } = capture.static;
  const points = rest.length / 3;
  // Blobs may leave memory; arrays of all frames would not.
  const pieces: Blob[] = [new Blob([npyHeader([frames, points, 3])])];
  const chunkFrames = Math.max(1, Math.floor(REQUEST_BYTES / (12 * rowsPerFrame)));
  for await (const { first, count, rows } of chunksOf(capture, frames, edits, signal, chunkFrames)) {
    const response = await capture.decode!(new Blob([rows]), signal);
    const expected = 12 * points * count;
    let received = 0;
    const counter = new TransformStream<Uint8Array, Uint8Array>({
      transform(piece, controller) {
        received += piece.length;
        onProgress?.((first + (count * received) / expected) / frames);
        controller.enqueue(piece);
      },
    });
    let positions: Blob;
    try {
      positions = await new Response(response.body!.pipeThrough(counter)).blob();
    } catch (error) {
      signal?.throwIfAborted();
      throw new Error('The connection was lost. Export again.', { cause: error });
    }
    if (received !== expected) throw new Error('The service sent too few frames. Export again.');
    pieces.push(positions);
  }
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
