/** Bits of a stream of zstd, which is read from its end: the highest bit that is set in its last byte marks where it begins. */
export class BackwardBits {
  /** Bits that are left; below zero after more were read than there are. */
  left: number;

  constructor(private readonly bytes: Uint8Array) {
    const last = bytes.length > 0 ? bytes[bytes.length - 1] : 0;
    if (last === 0) throw new Error('its bits have no beginning');
    this.left = 8 * (bytes.length - 1) + 31 - Math.clz32(last);
  }

  /** The next bits, 24 at the most, as a number; zeros where there are no more. */
  read(count: number): number {
    const { bytes } = this;
    this.left -= count;
    const left = this.left;
    const mask = (1 << count) - 1;
    if (left < 0) return left + count > 0 ? ((bytes[0] | (bytes[1] << 8) | (bytes[2] << 16)) << -left) & mask : 0;
    const at = left >> 3;
    const word = bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16) | (bytes[at + 3] << 24);
    return (word >>> (left & 7)) & mask;
  }
}
