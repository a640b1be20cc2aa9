import { changed } from '../container/error';
import { bytesSource, type Source } from '../container/source';
import { bodyOf, fetched } from './answers';
import { problemOf } from './problem';

interface HttpSourceOptions {
  /** Headers of every request, such as `Authorization`; a function gives those of the moment. */
  readonly headers?: HeadersInit | (() => HeadersInit);
  readonly signal?: AbortSignal | undefined;
  /** Bytes that the first request asks for: most containers' static part. */
  readonly firstBytes?: number;
}

/**
 * A resource that is read by ranges. All of them are of one version: where the server gives a strong ETag, requests are conditional on it. A server without
 * ranges sends everything at once.
 *
 * @throws {ServiceProblem} where the server refuses or does not answer.
 */
export async function httpSource(url: string, options: HttpSourceOptions = {}): Promise<Source> {
  const { headers, signal, firstBytes = 1 << 16 } = options;
  const request = async (range: string, signal?: AbortSignal, tag?: string) => {
    const all = new Headers(typeof headers === 'function' ? headers() : headers);
    all.set('Range', range);
    if (tag !== undefined) all.set('If-Range', tag);
    const response = await fetched(url, { headers: all, signal: signal ?? null });
    if (!response.ok && response.status !== 416) throw await problemOf(response);
    return response;
  };
  const first = await request(`bytes=0-${firstBytes - 1}`, signal);
  if (first.status === 416) {
    if (first.headers.get('Content-Range') === 'bytes */0') return bytesSource(new Uint8Array(0));
    throw changed();
  }
  const prefix = new Uint8Array(await bodyOf(first, signal));
  const start = rangeOf(first);
  if (start === null) return bytesSource(prefix);
  const { size } = start;
  const etag = first.headers.get('ETag');
  const tag = etag?.startsWith('W/') === false ? etag : undefined;
  if (start.offset !== 0 || prefix.length !== Math.min(size, firstBytes)) throw changed();
  return {
    size,
    async read(offset, length, signal) {
      if (offset + length <= prefix.length) return prefix.subarray(offset, offset + length);
      const response = await request(`bytes=${offset}-${offset + length - 1}`, signal, tag);
      const range = rangeOf(response);
      if (range?.offset !== offset || range.size !== size || response.headers.get('ETag') !== etag) {
        await response.body?.cancel();
        throw changed();
      }
      const bytes = new Uint8Array(await bodyOf(response, signal));
      if (bytes.length !== length) throw changed();
      return bytes;
    },
  };
}

/** Offset of a part of the resource, and the size of the whole; null of other answers. */
function rangeOf(response: Response): { offset: number; size: number } | null {
  const fields = /^bytes (\d+)-\d+\/(\d+)$/.exec(response.headers.get('Content-Range') ?? '');
  return response.status === 206 && fields !== null ? { offset: Number(fields[1]), size: Number(fields[2]) } : null;
}
