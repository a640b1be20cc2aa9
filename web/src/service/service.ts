/** Requests to the service: addresses, the token, and errors as {@link ServiceProblem}. */

import type { Source } from '../container/source';
import { bodyOf, fetched, piecesOf } from './answers';
import { persistently } from './backoff';
import { httpSource } from './httpSource';
import type { FrameResult, Session, SessionPage } from './messages';
import { ServiceProblem, networkProblem, problemBehind, problemOf } from './problem';
import { pageToken } from './token';

export interface Coordinates {
  readonly rows: number;
  readonly columns: number;
  /** `rows × columns`, row by row. */
  readonly values: Float32Array;
}

/** How long an answer that takes no work may take. */
const PATIENCE_SECONDS = 15;
/** How often in a row fetching Φ breaks off before it is given up. */
const COORDINATES_ATTEMPTS = 6;

function sending(method: string, body: object): RequestInit {
  return { method, headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body) };
}

/** The service beside the page, whatever prefix that has. All its requests carry the token, in a header. */
export class Service {
  private readonly base = new URL('v1/', document.baseURI);

  /**
   * A request; the answer's body is still to be read.
   *
   * @param path below `/v1/`
   * @throws ServiceProblem for any status that is no success, and where there is no answer
   */
  async request(path: string, init: RequestInit = {}): Promise<Response> {
    const sent = pageToken.token;
    const headers = new Headers(init.headers);
    new Headers(this.authorization()).forEach((value, name) => headers.set(name, value));
    const response = await fetched(this.address(path), { ...init, headers });
    if (response.ok) return response;
    const problem = await problemOf(response);
    // An answer to a token that was replaced meanwhile says nothing about the present one.
    if (problem.status === 401 && sent === pageToken.token) pageToken.refused();
    throw problem;
  }

  address(path: string): string {
    return new URL(path, this.base).href;
  }

  /** The headers that requests made elsewhere need. */
  authorization(): HeadersInit {
    return pageToken.token === null ? {} : { Authorization: `Bearer ${pageToken.token}` };
  }

  /** The container at `path`, to be read at random; `signal` ends opening it. */
  source(path: string, signal?: AbortSignal, firstBytes?: number): Promise<Source> {
    const headers = () => this.authorization();
    return httpSource(this.address(path), { headers, signal, ...(firstBytes !== undefined && { firstBytes }) });
  }

  async json<T>(path: string, init: RequestInit = {}): Promise<T> {
    const response = await this.request(path, init);
    try {
      return (await response.json()) as T;
    } catch (error) {
      throw networkProblem(error, init.signal);
    }
  }

  /** A page of sessions, newest first; `after` is the `next` of the page before. */
  sessions(after: string | null = null, signal?: AbortSignal): Promise<SessionPage> {
    const query = after === null ? '' : `?after=${encodeURIComponent(after)}`;
    return this.json(`sessions${query}`, { cache: 'no-store', signal: patiently(signal) });
  }

  session(id: string, signal?: AbortSignal): Promise<Session> {
    return this.json(sessionPath(id), { cache: 'no-store', signal: patiently(signal) });
  }

  /** Deletes a session; one that is gone already is no error. */
  async remove(id: string) {
    try {
      await this.request(sessionPath(id), { method: 'DELETE' });
    } catch (error) {
      const problem = problemBehind(error);
      if (!('isGone' in problem && problem.isGone === true)) throw problem;
    }
  }

  rename(id: string, name: string): Promise<Session> {
    return this.json(sessionPath(id), sending('PATCH', { name }));
  }

  complete(id: string, frames: number, signal?: AbortSignal): Promise<Session> {
    return this.json(sessionPath(id, 'complete'), { ...sending('POST', { frames }), signal: signal ?? null });
  }

  /** Errors of all solved frames, ascending. */
  async errors(id: string, signal?: AbortSignal): Promise<readonly FrameResult[]> {
    const init = { cache: 'no-store', signal: signal ?? null } as const;
    return (await this.json<{ frames: FrameResult[] }>(sessionPath(id, 'errors'), init)).frames;
  }

  /** The handles: point numbers, in the order in which `rows=handles` wants their rows. */
  async handles(id: string, signal?: AbortSignal): Promise<Uint32Array> {
    const response = await this.request(sessionPath(id, 'handles'), {
      headers: { Accept: 'application/octet-stream' },
      signal: signal ?? null,
    });
    return new Uint32Array(await bodyOf(response, signal));
  }

  /**
   * Φ, for harmonic and Green coordinates. What breaks off goes on where it was. The browser keeps it: it never changes.
   *
   * @param onProgress hears the part that has arrived, 0 to 1
   */
  async coordinates(id: string, onProgress?: (fraction: number) => void, signal?: AbortSignal): Promise<Coordinates> {
    let [rows, columns, filled, tag] = [0, 0, 0, ''];
    let bytes = new Uint8Array(0);
    const receive = async () => {
      const headers = new Headers({ Accept: 'application/octet-stream' });
      if (filled > 0) {
        headers.set('Range', `bytes=${filled}-`);
        headers.set('If-Range', tag);
      }
      const response = await this.request(sessionPath(id, 'coordinates'), { headers, signal: signal ?? null });
      if (response.status !== 206) {
        [rows, columns] = ['cager-rows', 'cager-columns'].map((name) => Number(response.headers.get(name)));
        await checkLength(response, 4 * rows * columns);
        [filled, tag] = [0, response.headers.get('etag') ?? ''];
        bytes = new Uint8Array(4 * rows * columns);
      }
      for await (const piece of piecesOf(response, signal)) {
        if (filled + piece.length > bytes.length) throw new Error('The service sent more coordinates than it said.');
        bytes.set(piece, filled);
        filled += piece.length;
        onProgress?.(filled / bytes.length);
      }
      if (filled < bytes.length) throw new ServiceProblem('unreachable', 0);
    };
    await persistently(receive, { signal, attempts: COORDINATES_ATTEMPTS });
    return { rows, columns, values: new Float32Array(bytes.buffer) };
  }
}

/** Checks what an answer says of its length, before there is memory for it. */
async function checkLength(response: Response, expected: number) {
  const length = Number(response.headers.get('content-length') ?? expected);
  if (Number.isSafeInteger(expected) && expected > 0 && length === expected) return;
  await response.body?.cancel();
  throw new Error('The service sent coordinates of another size than it said. Reload the page.');
}

/** Ends with the caller's signal, or after a while: a network that is lost answers nothing and ends nothing. */
export function patiently(signal?: AbortSignal): AbortSignal {
  const timeout = AbortSignal.timeout(1000 * PATIENCE_SECONDS);
  return signal ? AbortSignal.any([signal, timeout]) : timeout;
}

/** Address of a session, or of something below it, for {@link Service.request}. */
export function sessionPath(id: string, below?: string): string {
  const path = `sessions/${encodeURIComponent(id)}`;
  return below === undefined ? path : `${path}/${below}`;
}
