import { save } from '../save';
import type { Service } from '../service/service';
import { piecesOf, sessionPath } from '../service/service';

/**
 * Downloads a session's container through the page, since a plain link cannot carry the token, and has the browser save it.
 *
 * @param onProgress hears the part that has arrived, 0 to 1
 */
export async function downloadContainer(
  service: Service,
  id: string,
  name: string,
  onProgress: (part: number) => void,
): Promise<void> {
  const response = await service.request(sessionPath(id, 'capture.cager'));
  const total = Number(response.headers.get('content-length'));
  const pieces: BlobPart[] = [];
  let received = 0;
  for await (const piece of piecesOf(response, undefined)) {
    pieces.push(piece as Uint8Array<ArrayBuffer>);
    received += piece.length;
    if (total > 0) onProgress(Math.min(1, received / total));
  }
  if (total > 0 && received < total) throw new Error('The download broke off. Start it again.');
  // Signs that file systems do not take.
  const file = `${name.replace(/[\\/:*?"<>|\p{Cc}]+/gu, '-')}.cager`;
  save(new Blob(pieces, { type: 'application/vnd.cager' }), file);
}
