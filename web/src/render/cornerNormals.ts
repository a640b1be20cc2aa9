import { HalfFloatType, type Texture, type WebGLRenderer, type WebGLRenderTarget } from 'three';
import type { SplitNormals } from '../codec/surface/splitVertices';
import { fanTextures, ownerTexture, tiltTexture } from './dataTextures';
import { splitNormalShader } from './decodeShaders';
import { WIDTH } from './packing';
import { Pass, target } from './pass';

/** Normals of a model with hard edges, where points have several, or with tilted ones: computed as those of points are, when they are needed. */
export class CornerNormals {
  private readonly into: WebGLRenderTarget;
  private readonly pass: Pass;

  constructor(
    private readonly renderer: WebGLRenderer,
    split: SplitNormals,
    positions: Texture,
  ) {
    const gl = renderer.getContext();
    const limit = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    const bands = Math.ceil(split.points.length / WIDTH);
    if (bands > limit) throw new Error('The model has more hard edges than this device can draw.');
    const fans = fanTextures(split, bands, limit);
    this.into = target(bands, HalfFloatType);
    this.pass = new Pass(splitNormalShader, {
      positions: { value: positions },
      owners: { value: ownerTexture(split.points, split.next, bands) },
      tilts: { value: tiltTexture(split.tilts, bands) },
      areTilted: { value: split.tilts !== null },
      fanStarts: { value: fans.starts },
      fans: { value: fans.fans },
    });
  }

  get texture(): Texture {
    return this.into.texture;
  }

  compute() {
    const shown = this.renderer.getRenderTarget();
    this.pass.render(this.renderer, this.into);
    this.renderer.setRenderTarget(shown);
  }

  dispose() {
    // The positions are the decoder's.
    this.pass.uniforms.positions.value = null;
    this.pass.dispose();
    this.into.dispose();
  }
}
