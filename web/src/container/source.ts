/** Where the bytes of a container are, to be read at random. */

export interface Source {
  readonly size: number;
  /** Exactly `length` bytes from `offset` on, which both lie within the size. */
  read(offset: number, length: number, signal?: AbortSignal): Promise<Uint8Array>;
}

export function bytesSource(bytes: Uint8Array): Source {
  return {
    size: bytes.length,
    read: (offset, length) => Promise.resolve(bytes.subarray(offset, offset + length)),
  };
}

export function blobSource(blob: Blob): Source {
  return {
    size: blob.size,
    async read(offset, length) {
      let buffer: ArrayBuffer;
      try {
        buffer = await blob.slice(offset, offset + length).arrayBuffer();
      } catch {
        throw new Error('The file can no longer be read; it was changed or removed. Choose it again.');
      }
      return new Uint8Array(buffer);
    },
  };
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
    if (missing === 0 && (head.length === 0 || tail.length === 0)) return head.length > 0 ? head : tail;
    const middle = missing > 0 ? await this.source.read(offset + head.length, missing, signal) : new Uint8Array(0);
    if (middle.length === length) return middle;
    const bytes = new Uint8Array(length);
    bytes.set(head);
    bytes.set(middle, head.length);
    bytes.set(tail, length - tail.length);
    return bytes;
  }
}
