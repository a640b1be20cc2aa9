import { save } from '../save';
import type { Service } from '../service/service';
import { piecesOf } from '../service/answers';
import { sessionPath } from '../service/service';

/** What a session can be downloaded as beside its container, by the ending of the file's name. */
export const FORMATS = { abc: 'Alembic', usdc: 'USD', glb: 'glTF', npy: 'NumPy' };

/** Ending of the name of a downloaded file. */
export type Format = 'cager' | keyof typeof FORMATS;

/**
 * Downloads a session's container, or what the service decodes of it, through the page, since a plain link cannot carry the token, and has the browser save it.
 *
 * @param onProgress hears the part that has arrived, 0 to 1
 */
export async function download(
  service: Service,
  id: string,
  name: string,
  format: Format,
  onProgress: (part: number) => void,
) {
  const path = format === 'cager' ? sessionPath(id, 'capture.cager') : `${sessionPath(id, 'export')}?format=${format}`;
  const response = await service.request(path);
  const total = Number(response.headers.get('content-length'));
  const pieces: BlobPart[] = [];
  let received = 0;
  for await (const piece of piecesOf(response, undefined)) {
    pieces.push(piece as Uint8Array<ArrayBuffer>);
    received += piece.length;
    if (total > 0) onProgress(Math.min(1, received / total));
  }
  if (total > 0 && received < total) throw new Error('The download was interrupted. Start it again.');
  save(new Blob(pieces, { type: response.headers.get('content-type') ?? '' }), `${name}.${format}`);
}
