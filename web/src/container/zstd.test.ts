import { expect, it } from 'vitest';
import { decompress } from './zstd';

/** What `zstd -19` makes of {@link text}: Huffman codes, and tables of all three kinds of lengths. */
const FRAME = `
KLUv/WAgC2UPAJbxYRWQJ4U2aD/2Vzn1/6Zc2pJb9sDXH+RfAFkAWwBm7To2JuLY8421W2DDSWCrQrFEUuwrEDsnxMrtrP2zIRFnzzWsXYYNZ8JWkbBEIuzrzM6VWfnN2mI2HGbPxtqL
DXe2algiYV9m51g5a7NBAAM4KEBwgEABBwEMsEAAI7UlDBsVUcOe7cPaa4YNdxm2ajwskcSwL5+wc2HCyiMIa0cJGxRBwp7jwtpjhA0XImyVLSyRhLCvObNzN7PyCmZti0eU2bOQWftv
NlyN2aojEjH7IpudM7lE7FkusPaHwIYrCmzVTWCJRAL7ogjsnFmxcgnF2kXFhkW82POlWLtFseHkiK0KgVgiKWJf4cTOyRArNxNrP4iNEHFnzxXO2qXOhrOfraI5SyRy9nVxdq5uWPlt
GOzZ5Zs1Xi7wrIpFJ5PImD3rbngVhD+ZlglHWMwebWZ8VeD9xRqhIAmbPcs2vCiJx8Osw5QwGxFmz2HH2qOODRc/tspyLJHEsa8xY+dexsrrxtomxsZF2AKAh6gRYBQBhKivZc/QU4Y5
EYCEfxK/BkSGaH0cvBi3jyPhJoy7z4gkEkZYeCK9905kMf1JubDS8CjdmHqlXFhpeJR6hl5P+R2Nip/nawvMLBuLmcBZsCwbGItZDWQwxMxIFQ==`;
const text = Array.from({ length: 120 }, (_, k) => `${k * k} is the square of ${k}. `).join('');
const frame = Uint8Array.from(Buffer.from(FRAME, 'base64'));

/** A frame of one compressed block. */
function frameOf(size: number, block: readonly number[]): Uint8Array {
  const header = (block.length << 3) | 4 | 1;
  return Uint8Array.of(0x28, 0xb5, 0x2f, 0xfd, 0x20, size, header & 255, header >> 8, 0, ...block);
}

it('gives back what was compressed', () => {
  expect(new TextDecoder().decode(decompress(frame, text.length))).toBe(text);
});

it('refuses every frame that is cut, and those with a bit changed or another result', () => {
  for (let length = 0; length < frame.length; length++) {
    expect(() => decompress(frame.subarray(0, length), text.length), `${length} bytes`).toThrow();
  }
  for (let bit = 0; bit < 8 * frame.length; bit += 11) {
    const changed = frame.slice();
    changed[bit >> 3] ^= 1 << (bit & 7);
    let result: Uint8Array | null = null;
    try {
      result = decompress(changed, text.length);
    } catch (error) {
      expect((error as Error).message).toMatch(/^(it|its|a) /);
    }
    if (result) expect(result).toHaveLength(text.length);
  }
});

it('writes no more than was declared, however long the matches of a few bytes are', () => {
  // 98,047 matches of 65,539 bytes, whose codes take no bits.
  const block = [0, 255, 255, 255, 0x54, 0, 0, 52, 1];
  const began = performance.now();
  expect(() => decompress(frameOf(100, block), 100)).toThrow(/longer than declared/);
  expect(performance.now() - began).toBeLessThan(500);
});
