import { HalfFloatType, type DataTexture, type WebGLRenderTarget } from 'three';
import { floatTexture } from './dataTextures';
import { normalShader } from './decodeShaders';
import { WIDTH } from './packing';
import { Pass, target } from './pass';

/** A frame that is given as positions: these, the normals that follow, and the pass that computes them. */
export interface PlacedFrame {
  readonly positions: DataTexture;
  readonly normals: WebGLRenderTarget;
  readonly pass: Pass;
}

/** @param like computes normals of decoded frames of the same model */
export function placedFrame(bands: number, like: Pass): PlacedFrame {
  const positions = floatTexture(new Float32Array(4 * WIDTH * bands), WIDTH, bands);
  const pass = new Pass(normalShader, { ...like.uniforms, positions: { value: positions } });
  return { positions, normals: target(bands, HalfFloatType), pass };
}
