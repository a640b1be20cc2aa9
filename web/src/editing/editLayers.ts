import type { Capture, EditLayer, FrameBlock, StaticPart } from '../capture';
import { layerBetween } from '../container/layers';
import { counts, editedRows, type CageEdit } from './cageEdit';

export type Frames = Pick<Capture, 'block' | 'frames'> & { readonly static: Pick<StaticPart, 'rowsPerFrame' | 'cage'> };

/**
 * Edits of a capture as layers over its frames, one each, in the order in which they are made; those that change nothing have none.
 *
 * @param onProgress hears the part of the edits that is done, 0 to 1
 */
export async function layersOf(
  capture: Frames,
  edits: readonly CageEdit[],
  { signal, onProgress }: { readonly signal?: AbortSignal; readonly onProgress?: (fraction: number) => void } = {},
): Promise<EditLayer[]> {
  const made: CageEdit[] = [];
  const layers: EditLayer[] = [];
  const length = capture.static.cage.positions.length;
  for (const edit of edits.filter(counts)) {
    const { first, last } = edit.range;
    const [before, after]: [Float32Array[], Float32Array[]] = [[], []];
    for await (const { frame, rows } of framesOf(capture, first, Math.min(last + 1, capture.frames), signal)) {
      before.push(editedRows(rows, frame, made).slice(0, length));
      after.push(editedRows(rows, frame, [...made, edit]).slice(0, length));
    }
    const layer = layerBetween(before, after, first, nameOf(edit));
    if (layer) layers.push(layer);
    made.push(edit);
    onProgress?.(made.length / edits.length);
  }
  return layers;
}

/** What an edit is called: its vertices. */
export function nameOf({ grip: { chosen } }: CageEdit): string {
  return chosen.length === 1 ? `Vertex ${chosen[0]}` : `${chosen.length} vertices`;
}

/** Frames of a capture one after another, up to the one before `end`, each with its block and its rows there. */
export async function* framesOf(
  capture: Frames,
  first: number,
  end: number,
  signal?: AbortSignal,
): AsyncGenerator<{ readonly frame: number; readonly block: FrameBlock; readonly rows: Float32Array }> {
  const width = 3 * capture.static.rowsPerFrame;
  for (let frame = first; frame < end;) {
    const block = await capture.block(frame, signal);
    const stop = Math.min(end, block.first + block.count);
    if (frame < block.first || frame >= stop)
      throw new Error(`Frame ${frame} is not where the capture says; load it again.`);
    for (; frame < stop; frame++) {
      const at = (frame - block.first) * width;
      yield { frame, block, rows: block.cages.subarray(at, at + width) };
    }
  }
}
