import {
  DataArrayTexture,
  DataTexture,
  FloatType,
  RedFormat,
  RGBAFormat,
  RGBAIntegerFormat,
  RGFormat,
  RGIntegerFormat,
  ShortType,
  SRGBColorSpace,
  UnsignedByteType,
  UnsignedIntType,
} from 'three';
import type { PhiLayout } from './packing';
import { WIDTH } from './packing';
import { FAN_WIDTH } from './decodeShaders';
import type { Fans } from '../codec/polygons';

/** Φ as it was packed, 16-bit integers or full floats. */
export function phiTexture(texels: Int16Array | Float32Array, layout: PhiLayout): DataArrayTexture {
  const texture = new DataArrayTexture(texels, WIDTH, layout.height, layout.layers);
  texture.format = texels instanceof Int16Array ? RGBAIntegerFormat : RGBAFormat;
  texture.type = texels instanceof Int16Array ? ShortType : FloatType;
  if (texels instanceof Int16Array) texture.internalFormat = 'RGBA16I';
  texture.needsUpdate = true;
  return texture;
}

/** Four floats per texel, `data` when it is not empty. */
export function floatTexture(data: Float32Array, width: number, height: number): DataTexture {
  const texture = new DataTexture(data, width, height, RGBAFormat, FloatType);
  texture.needsUpdate = true;
  return texture;
}

/** One float per point, in the arrangement of all textures that hold something for each point. */
export function pointValueTexture(values: Float32Array, bands: number): DataTexture {
  const data = new Float32Array(WIDTH * bands);
  data.set(values.subarray(0, data.length));
  const texture = new DataTexture(data, WIDTH, bands, RedFormat, FloatType);
  texture.needsUpdate = true;
  return texture;
}

/** The colour of each point, in the arrangement of {@link pointValueTexture}; shaders read it as light. */
export function pointColorTexture(colors: Uint8Array, bands: number): DataTexture {
  const data = new Uint8Array(4 * WIDTH * bands);
  for (let p = 0; p < colors.length / 3; p++) {
    for (let k = 0; k < 3; k++) data[4 * p + k] = colors[3 * p + k];
  }
  const texture = new DataTexture(data, WIDTH, bands, RGBAFormat, UnsignedByteType);
  texture.colorSpace = SRGBColorSpace;
  texture.needsUpdate = true;
  return texture;
}

/** The triangles around each point: where they begin and how many, and the list of their other corners. */
export function fanTextures(surface: Fans, bands: number, limit: number): { starts: DataTexture; fans: DataTexture } {
  const points = surface.fanStarts.length - 1;
  const ranges = new Uint32Array(2 * WIDTH * bands);
  for (let p = 0; p < points; p++) {
    ranges[2 * p] = surface.fanStarts[p];
    ranges[2 * p + 1] = surface.fanStarts[p + 1] - surface.fanStarts[p];
  }
  const height = Math.max(1, Math.ceil(surface.fans.length / (2 * FAN_WIDTH)));
  if (height > limit) throw new Error('The model has more faces than this device can draw; open it on another device.');
  const padded = new Uint32Array(2 * FAN_WIDTH * height);
  padded.set(surface.fans);
  return { starts: pairTexture(ranges, WIDTH, bands), fans: pairTexture(padded, FAN_WIDTH, height) };
}

/** The point of each normal and the point beside it, in the arrangement of {@link pointValueTexture}. */
export function ownerTexture(points: Uint32Array, next: Uint32Array, bands: number): DataTexture {
  const data = new Uint32Array(2 * WIDTH * bands);
  points.forEach((point, k) => data.set([point, next[k]], 2 * k));
  return pairTexture(data, WIDTH, bands);
}

/** Two angles of each normal, in the arrangement of {@link pointValueTexture}; without any a texture of nothing. */
export function tiltTexture(angles: Float32Array | null, bands: number): DataTexture {
  const [width, height] = angles ? [WIDTH, bands] : [1, 1];
  const data = new Float32Array(2 * width * height);
  if (angles) data.set(angles);
  const texture = new DataTexture(data, width, height, RGFormat, FloatType);
  texture.needsUpdate = true;
  return texture;
}

function pairTexture(data: Uint32Array<ArrayBuffer>, width: number, height: number): DataTexture {
  const texture = new DataTexture(data, width, height, RGIntegerFormat, UnsignedIntType);
  texture.needsUpdate = true;
  return texture;
}
