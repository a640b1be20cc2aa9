/** Bytes that arrive in pieces of any size and are taken in pieces of others. */
export class ByteQueue {
  private buffer = new Uint8Array(1 << 12);
  private start = 0;
  private end = 0;

  get length(): number {
    return this.end - this.start;
  }

  append(piece: Uint8Array): void {
    if (this.end + piece.length > this.buffer.length) {
      const needed = this.length + piece.length;
      const target = needed > this.buffer.length / 2 ? new Uint8Array(2 * needed) : this.buffer;
      target.set(this.buffer.subarray(this.start, this.end));
      [this.buffer, this.start, this.end] = [target, 0, this.length];
    }
    this.buffer.set(piece, this.end);
    this.end += piece.length;
  }

  /** Takes so many bytes from the front, a copy; null if there are fewer. */
  take(length: number): Uint8Array | null {
    if (length > this.length) {
      return null;
    }
    this.start += length;
    return this.buffer.slice(this.start - length, this.start);
  }

  /** Takes all there is, at most so many bytes. */
  takeUpTo(length: number): Uint8Array {
    return this.take(Math.min(length, this.length))!;
  }
}
