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
  type HalfFloatType,
  type IUniform,
  type Texture,
  type WebGLRenderer,
} from 'three';
import { coverVertexShader } from './decodeShaders';
import { numberedGeometry, shaderMaterial } from './materials';
import { WIDTH } from './packing';

/** A fragment shader that runs once for every texel of a target. */
export class Pass {
  readonly uniforms: Record<string, IUniform>;
  private readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly camera = new Camera();

  constructor(fragmentShader: string, uniforms: Record<string, IUniform>) {
    this.uniforms = uniforms;
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
