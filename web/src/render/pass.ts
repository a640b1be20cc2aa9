import {
  type BufferGeometry,
  Camera,
  Mesh,
  NearestFilter,
  NoBlending,
  type RawShaderMaterial,
  RGBAFormat,
  WebGLRenderTarget,
  type FloatType,
  HalfFloatType,
  type IUniform,
  type Texture,
  type WebGLRenderer,
  type DataTexture,
} from 'three';
import { coverVertexShader, normalShader } from './decodeShaders';
import { numberedGeometry, shaderMaterial } from './materials';
import { WIDTH } from './packing';
import { floatTexture } from './dataTextures';

/** A fragment shader that runs once for every texel of a target. */
export class Pass {
  private readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly camera = new Camera();

  constructor(
    fragmentShader: string,
    readonly uniforms: Record<string, IUniform>,
  ) {
    const drawing = { depthTest: false, depthWrite: false, blending: NoBlending };
    const material = shaderMaterial(coverVertexShader, fragmentShader, uniforms, drawing);
    this.mesh = new Mesh(numberedGeometry(Uint32Array.of(0, 1, 2)), material);
    this.mesh.frustumCulled = false;
  }

  render(renderer: WebGLRenderer, into: WebGLRenderTarget) {
    renderer.setRenderTarget(into);
    renderer.render(this.mesh, this.camera);
  }

  dispose() {
    for (const { value } of Object.values(this.uniforms)) (value as Partial<Texture> | null)?.dispose?.();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}

/** A target with a texel for each point. */
export function target(bands: number, type: typeof FloatType | typeof HalfFloatType): WebGLRenderTarget {
  return new WebGLRenderTarget(WIDTH, bands, {
    type,
    format: RGBAFormat,
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthBuffer: false,
  });
}

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
