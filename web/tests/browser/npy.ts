/** An array of a `.npy` file: frames × points × 3, single or double precision. */
export interface NpyArray {
  readonly shape: readonly number[];
  readonly values: Float32Array | Float64Array;
}

/** Reads a `.npy` file of little-endian floats in C order. */
export function parseNpy(bytes: Uint8Array): NpyArray {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const wide = bytes[6] >= 2;
  const start = wide ? 12 : 10;
  const length = wide ? view.getUint32(8, true) : view.getUint16(8, true);
  const header = new TextDecoder('latin1').decode(bytes.subarray(start, start + length));
  const type = /'descr': *'<f([48])'/.exec(header)?.[1];
  const shape = /'shape': *\(([\d, ]*)\)/.exec(header)?.[1];
  if (type === undefined || shape === undefined || header.includes("'fortran_order': True")) {
    throw new Error(`not an array of floats: ${header}`);
  }
  // Copied: a Buffer of Node lies somewhere within a larger one.
  const body = Uint8Array.from(bytes.subarray(start + length)).buffer;
  return {
    shape: shape.split(',').filter(Boolean).map(Number),
    values: type === '4' ? new Float32Array(body) : new Float64Array(body),
  };
}
