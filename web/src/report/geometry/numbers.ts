/** Numbers of a report's geometry: little-endian bytes as base64. `src/report_page/numbers.rs` of the program writes them. */

/** Points or vectors as unsigned integers of 8 or 16 bits: a coordinate is `low + step · integer`. */
export interface Quantised {
  readonly low: readonly [number, number, number];
  readonly step: number;
  readonly bits: 8 | 16;
  readonly data: string;
}

export function floats(text: string): Float32Array {
  return new Float32Array(bytesOf(text).buffer);
}

/** Numbers of vertices, of which there are `vertices`. */
export function indices(text: string, vertices: number): Uint32Array {
  const { buffer } = bytesOf(text);
  return vertices <= 0x1_0000 ? Uint32Array.from(new Uint16Array(buffer)) : new Uint32Array(buffer);
}

/** x y z of each point. */
export function coordinates({ low, step, bits, data }: Quantised): Float32Array {
  const bytes = bytesOf(data);
  const integers = bits === 8 ? bytes : new Uint16Array(bytes.buffer);
  const found = new Float32Array(integers.length);
  for (let k = 0; k < found.length; k++) found[k] = low[k % 3] + step * integers[k];
  return found;
}

/** Browsers that run on other than little-endian machines are not made any more. */
function bytesOf(text: string): Uint8Array<ArrayBuffer> {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = characters.charCodeAt(k);
  return bytes;
}
