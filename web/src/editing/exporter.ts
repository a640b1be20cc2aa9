import type { Capture } from '../capture';
import { save } from '../save';
import type { CageEdit } from './cageEdit';
import { decodedFrames } from './decodedFrames';
import { writeEdited } from './editedContainer';

export type ExportKind = 'container' | 'frames';

/** Why a capture cannot be saved as something, in a sentence; null where it can. */
export function obstacle(capture: Capture, kind: ExportKind): string | null {
  if (!capture.complete) return 'The capture is still running. Export it when it is complete.';
  if (kind === 'container' && !capture.container) return 'There is no .cager file of this capture.';
  if (kind === 'frames' && !capture.decode) {
    return 'Frames are decoded by a service: open the capture as a session, or run cager decode on the exported file.';
  }
  return null;
}

/** Makes a file of a capture with its edits, and has the browser save it. */
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
