/** Where the bytes of a container are, to be read at random. */

import { problemBehind, problemOf } from '../service/problem';
import { changed } from './error';

export interface Source {
  /** Length in bytes. */
  readonly size: number;
  /** Exactly `length` bytes from `offset` on, which both lie within the size. */
  read(offset: number, length: number, signal?: AbortSignal): Promise<Uint8Array>;
}

/** Bytes in memory. */
export function bytesSource(bytes: Uint8Array): Source {
  return {
    size: bytes.length,
    read: (offset, length) => Promise.resolve(bytes.subarray(offset, offset + length)),
  };
}

/** A file that was chosen or dropped. */
export function blobSource(blob: Blob): Source {
  return {
    size: blob.size,
    async read(offset, length) {
      let buffer: ArrayBuffer;
      try {
        buffer = await blob.slice(offset, offset + length).arrayBuffer();
      } catch {
        throw new Error('The file cannot be read any more; it was changed or removed. Choose it again.');
      }
      return new Uint8Array(buffer);
    },
  };
}

export interface HttpSourceOptions {
  /** Headers of every request, such as `Authorization`; a function gives those of the moment. */
  readonly headers?: HeadersInit | (() => HeadersInit);
  readonly signal?: AbortSignal | undefined;
}

/** Bytes that the first request asks for: most containers' static part. */
const FIRST_BYTES = 1 << 16;

/**
 * A resource that is read by ranges. All of them are of one version: where the server gives a strong ETag, requests are conditional on it. A server without
 * ranges sends everything at once.
 *
 * @throws {ServiceProblem} where the server refuses or does not answer.
 */
export async function httpSource(url: string, { headers, signal }: HttpSourceOptions = {}): Promise<Source> {
  const requestHeaders = (range: string) => {
    const all = new Headers(typeof headers === 'function' ? headers() : headers);
    all.set('Range', range);
    return all;
  };
  const first = await request(url, requestHeaders(`bytes=0-${FIRST_BYTES - 1}`), signal);
  if (first.status === 416 && first.headers.get('Content-Range') === 'bytes */0') {
    return bytesSource(new Uint8Array(0));
  }
  const start = rangeOf(first);
  if (start === null) {
    return bytesSource(await bodyOf(first, signal));
  }
  const size = start.size;
  const etag = first.headers.get('ETag');
  const isStrong = etag !== null && !etag.startsWith('W/');
  const prefix = await bodyOf(first, signal);
  if (start.offset !== 0 || prefix.length !== Math.min(size, FIRST_BYTES)) {
    throw changed();
  }
  return {
    size,
    async read(offset, length, signal) {
      if (offset + length <= prefix.length) {
        return prefix.subarray(offset, offset + length);
      }
      const conditional = requestHeaders(`bytes=${offset}-${offset + length - 1}`);
      if (isStrong) {
        conditional.set('If-Range', etag);
      }
      const response = await request(url, conditional, signal);
      const range = rangeOf(response);
      if (range?.offset !== offset || range.size !== size || response.headers.get('ETag') !== etag) {
        await response.body?.cancel();
        throw changed();
      }
      const bytes = await bodyOf(response, signal);
      if (bytes.length !== length) {
        throw changed();
      }
      return bytes;
    },
  };
}

async function request(url: string, headers: Headers, signal: AbortSignal | undefined): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(url, { headers, signal: signal ?? null });
  } catch (error) {
    throw problemBehind(error, signal);
  }
  if (!response.ok && response.status !== 416) {
    throw await problemOf(response);
  }
  return response;
}

async function bodyOf(response: Response, signal: AbortSignal | undefined): Promise<Uint8Array> {
  if (response.status === 416) {
    throw changed();
  }
  try {
    return new Uint8Array(await response.arrayBuffer());
  } catch (error) {
    throw problemBehind(error, signal);
  }
}

/** Offset of a part of the resource, and the size of the whole; null of other answers. */
function rangeOf(response: Response): { offset: number; size: number } | null {
  const fields = /^bytes (\d+)-\d+\/(\d+)$/.exec(response.headers.get('Content-Range') ?? '');
  return response.status === 206 && fields !== null ? { offset: Number(fields[1]), size: Number(fields[2]) } : null;
}

/** A source whose first and last bytes are read once, since everything small is there. */
export class EndsCache implements Source {
  readonly size: number;

  private constructor(
    private readonly source: Source,
    private readonly first: Uint8Array,
    private readonly last: Uint8Array,
  ) {
    this.size = source.size;
  }

  /** Reads so many bytes of the beginning, and of the end as far as they are others. */
  static async of(source: Source, firstBytes: number, lastBytes: number, signal?: AbortSignal): Promise<EndsCache> {
    const first = Math.min(source.size, firstBytes);
    const last = Math.min(source.size - first, lastBytes);
    const read = [source.read(0, first, signal), source.read(source.size - last, last, signal)];
    return new EndsCache(source, ...((await Promise.all(read)) as [Uint8Array, Uint8Array]));
  }

  async read(offset: number, length: number, signal?: AbortSignal): Promise<Uint8Array> {
    const end = offset + length;
    const behind = this.size - this.last.length;
    const head = this.first.subarray(offset, end);
    const tail = this.last.subarray(Math.max(0, offset - behind), Math.max(0, end - behind));
    const missing = length - head.length - tail.length;
    if (missing === 0 && (head.length === 0 || tail.length === 0)) {
      return head.length > 0 ? head : tail;
    }
    const middle = missing > 0 ? await this.source.read(offset + head.length, missing, signal) : new Uint8Array(0);
    if (middle.length === length) {
      return middle;
    }
    const bytes = new Uint8Array(length);
    bytes.set(head);
    bytes.set(middle, head.length);
    bytes.set(tail, length - tail.length);
    return bytes;
  }
}
