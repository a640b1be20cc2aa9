import {
  FloatType,
  HalfFloatType,
  Vector2,
  Vector3,
  type DataArrayTexture,
  type DataTexture,
  type Texture,
  type WebGLRenderer,
  type WebGLRenderTarget,
} from 'three';
import type { StaticPart } from '../capture';
import { columnsOf } from '../coordinates/compute';
import { TiedNormals } from '../coordinates/tiedNormals';
import { diagonalOf, middleOf } from '../coordinates/topology';
import { fanTextures, floatTexture, phiTexture } from './dataTextures';
import { normalShader, positionShader } from './decodeShaders';
import { cageSize, layoutOf, meanOf, packPhi, WIDTH, type PhiLayout } from './packing';
import { Pass, target, placedFrame, type PlacedFrame } from './pass';
import { multiply, type ColumnValues } from './product';
import type { Surface } from './surface';

/** What is added to the positions of a frame by a residual layer: x y z and one unused number of each point. */
export type Offsets = Float32Array | null;

/** A frame, or something between two frames. */
export interface Pose {
  /** Rows that Φ multiplies, `rowsPerFrame × 3`. */
  readonly rows: Float32Array | Float64Array;
  /** Offsets of the frames before and after, and how much the latter counts. */
  readonly before: Offsets;
  readonly after: Offsets;
  readonly mix: number;
}

/** What multiplies Φ by cages: the graphics processor, or the page where the browser draws in software. */
export type Multiplier = 'graphics' | 'page';

/**
 * Decodes frames: one pass of the graphics processor multiplies Φ by a cage and writes positions into a texture, a second one writes normals. Until Φ is
 * there, the textures have the rest pose.
 *
 * The textures are in units of the rest pose's diagonal, relative to the middle of its bounding box; {@link place} converts.
 */
export class Decoder {
  /** Bits of an entry of Φ, and what rounding to them moves a point by at the most, in fractions of the diagonal. */
  precision = { bits: 32, error: 0 };
  readonly columns: number;
  readonly points: number;
  /** Length of the rest pose's diagonal, in the capture's unit. */
  readonly diagonal: number;
  /** Middle of the rest pose's bounding box. */
  readonly centre: readonly [number, number, number];
  private readonly layout: PhiLayout;
  private readonly tiedNormals: TiedNormals | null;
  private readonly values: Float64Array;
  private readonly cageTexture: DataTexture;
  private readonly offsetTextures: readonly [DataTexture, DataTexture];
  private readonly shownOffsets: [Offsets, Offsets] = [null, null];
  /** What the page has multiplied, and the rest pose before. */
  private readonly products: DataTexture;
  private readonly positionTarget: WebGLRenderTarget;
  private readonly normalTarget: WebGLRenderTarget;
  private readonly positionUniforms;
  private positionPass: Pass;
  private readonly normalPass: Pass;
  private motionTarget: WebGLRenderTarget | null = null;
  private placed: PlacedFrame | null = null;
  /** Φ, in the graphics processor's memory or in that of the page. */
  private phi: DataArrayTexture | Float32Array | null = null;
  private isDisposed = false;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly capture: StaticPart,
    surface: Surface,
    private readonly multiplier: Multiplier,
  ) {
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const limits = {
      size: gl.getParameter(gl.MAX_TEXTURE_SIZE) as number,
      layers: gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number,
    };
    this.points = capture.rest.length / 3;
    this.columns = columnsOf(capture.system, capture.cage);
    this.diagonal = diagonalOf(capture.rest) || 1;
    this.centre = middleOf(capture.rest);
    this.layout = layoutOf(this.points, this.columns, limits);
    this.tiedNormals = capture.system === 'green' ? new TiedNormals(capture.cage) : null;
    this.values = new Float64Array(3 * this.columns);
    this.cageTexture = floatTexture(new Float32Array(12 * this.layout.blocks), this.layout.blocks, 3);
    const { bands } = this.layout;
    const offsetsOf = () => floatTexture(new Float32Array(4 * WIDTH * bands), WIDTH, bands);
    this.offsetTextures = [offsetsOf(), offsetsOf()];
    this.products = offsetsOf();
    this.positionTarget = target(bands, FloatType);
    this.normalTarget = target(bands, HalfFloatType);
    this.positionUniforms = {
      phi: { value: null as DataArrayTexture | null },
      products: { value: this.products },
      scale: { value: 1 },
      cage: { value: this.cageTexture },
      offsetsBefore: { value: this.offsetTextures[0] },
      offsetsAfter: { value: this.offsetTextures[1] },
      offsetWeights: { value: new Vector2() },
      origin: { value: new Vector3() },
      blocks: { value: this.layout.blocks },
      bandsPerLayer: { value: this.layout.bandsPerLayer },
    };
    this.positionPass = new Pass(positionShader('products'), this.positionUniforms);
    const fans = fanTextures(surface, bands, limits.size);
    this.normalPass = new Pass(normalShader, {
      positions: { value: this.positions },
      fanStarts: { value: fans.starts },
      fans: { value: fans.fans },
    });
  }

  /** Position of point i in texel (i mod WIDTH, ⌊i / WIDTH⌋). */
  get positions(): Texture {
    return this.positionTarget.texture;
  }

  /** Unit normals, as {@link positions}. */
  get normals(): Texture {
    return this.normalTarget.texture;
  }

  get bands(): number {
    return this.layout.bands;
  }

  get ready(): boolean {
    return this.phi !== null;
  }

  /** Takes Φ, points × columns. */
  async setPhi(phi: Float32Array): Promise<void> {
    if (phi.length !== this.points * this.columns)
      throw new Error('The coordinates are not those of this model and cage; reload the page.');
    if (this.multiplier === 'page') {
      this.phi = phi;
      return;
    }
    const packed = await packPhi(phi, this.columns, cageSize(this.capture), this.layout);
    if (this.isDisposed) return;
    const compact = packed.texels instanceof Int16Array;
    this.phi = this.positionUniforms.phi.value = phiTexture(packed.texels, this.layout);
    this.precision = { bits: compact ? 16 : 32, error: packed.error };
    this.positionUniforms.scale.value = compact ? packed.scale / 32767 ** 2 : 1;
    this.positionPass.dispose();
    this.positionPass = new Pass(positionShader(compact ? 'integers' : 'floats'), this.positionUniforms);
  }

  /** What the columns of Φ multiply for the rows of a frame, x y z each. */
  valuesOf(rows: Float32Array): Float64Array {
    const values = new Float64Array(this.values.length);
    this.fillColumns(rows, values);
    return values;
  }

  /** Converts a point of the capture, in its unit, to the unit of the textures; all three axes in place. */
  place(positions: Float32Array) {
    for (let k = 0; k < positions.length; k++) positions[k] = (positions[k] - this.centre[k % 3]) / this.diagonal;
  }

  /** Computes positions and normals of a pose. Does nothing before Φ is there. */
  decode(pose: Pose) {
    if (!this.ready) return;
    this.fillColumns(pose.rows, this.values);
    this.multiplyBy(this.centre);
    this.setOffsets(pose, 1 - pose.mix, pose.mix);
    this.draw(this.positionTarget, this.normalTarget);
  }

  /** Writes the rest pose into the textures, as long as Φ is not there. */
  showRest() {
    if (this.ready) return;
    this.writeTexels(this.products, this.capture.rest);
    this.draw(this.positionTarget, this.normalTarget);
  }

  /** Computes how far each point moves from one frame to the next, into a texture like {@link positions}; null before Φ is there. */
  decodeMotion(
    pose: Pick<Pose, 'before' | 'after'>,
    rowsBefore: Float32Array,
    rowsAfter: Float32Array,
  ): Texture | null {
    if (!this.ready) return null;
    this.motionTarget ??= target(this.bands, FloatType);
    const earlier = this.valuesOf(rowsBefore);
    this.fillColumns(rowsAfter, this.values);
    for (let k = 0; k < earlier.length; k++) this.values[k] -= earlier[k];
    this.multiplyBy([0, 0, 0]);
    this.setOffsets(pose, -1, 1);
    this.draw(this.motionTarget, null);
    return this.motionTarget.texture;
  }

  /** Takes a frame that is given as positions, x y z of each point in the capture's unit, and computes its normals; into textures of their own. */
  placeFrame(positions: Float32Array) {
    this.placed ??= placedFrame(this.bands, this.normalPass);
    this.writeTexels(this.placed.positions, positions);
    const shown = this.renderer.getRenderTarget();
    this.placed.pass.render(this.renderer, this.placed.normals);
    this.renderer.setRenderTarget(shown);
  }

  /** Textures of {@link placeFrame}, like {@link positions} and {@link normals}; null before there is one. */
  get placedTextures(): { readonly positions: Texture; readonly normals: Texture } | null {
    return this.placed && { positions: this.placed.positions, normals: this.placed.normals.texture };
  }

  /** Positions of the pose that was decoded last, x y z of each point in the capture's unit. Waits for the graphics processor. */
  readPositions(): Float32Array {
    const texels = new Float32Array(4 * WIDTH * this.bands);
    this.renderer.readRenderTargetPixels(this.positionTarget, 0, 0, WIDTH, this.bands, texels);
    const positions = new Float32Array(3 * this.points);
    for (let p = 0; p < this.points; p++) {
      for (let k = 0; k < 3; k++) positions[3 * p + k] = texels[4 * p + k] * this.diagonal + this.centre[k];
    }
    return positions;
  }

  dispose() {
    this.isDisposed = true;
    if (this.phi && !(this.phi instanceof Float32Array)) this.phi.dispose();
    for (const texture of [this.cageTexture, this.products, ...this.offsetTextures]) texture.dispose();
    this.positionTarget.dispose();
    this.normalTarget.dispose();
    this.motionTarget?.dispose();
    this.placed?.normals.dispose();
    this.placed?.pass.dispose();
    this.positionPass.dispose();
    this.normalPass.dispose();
  }

  /** Rows of a frame and, for `green`, the normals that follow from them: what the columns of Φ multiply. */
  private fillColumns(rows: Float32Array | Float64Array, values: Float64Array) {
    values.set(rows);
    this.tiedNormals?.write(rows, values, this.capture.cage.positions.length);
  }

  /** Runs the pass that writes positions or movements, and the one that writes normals where there is a target for them. */
  private draw(positions: WebGLRenderTarget, normals: WebGLRenderTarget | null) {
    const shown = this.renderer.getRenderTarget();
    this.positionPass.render(this.renderer, positions);
    if (normals) this.normalPass.render(this.renderer, normals);
    this.renderer.setRenderTarget(shown);
  }

  /** Writes positions, x y z of each point in the capture's unit, into a texture like {@link positions}. */
  private writeTexels(texture: DataTexture, positions: ArrayLike<number>) {
    const texels = texture.image.data as unknown as Float32Array;
    for (let p = 0; p < this.points; p++) {
      for (let k = 0; k < 3; k++) texels[4 * p + k] = (positions[3 * p + k] - this.centre[k]) / this.diagonal;
    }
    texture.needsUpdate = true;
  }

  /**
   * Takes the values of all columns, those of vertices relative to their mean, and that mean relative to `zero`: for the graphics processor to multiply,
   * or multiplied.
   */
  private multiplyBy(zero: readonly [number, number, number]) {
    const { values, columns, diagonal, phi } = this;
    const vertices = this.capture.cage.positions.length / 3;
    const mean = meanOf(values, vertices);
    const axes = [0, 1, 2].map((k) =>
      Float64Array.from({ length: columns }, (_, column) => {
        return (values[3 * column + k] - (column < vertices ? mean[k] : 0)) / diagonal;
      }),
    ) as unknown as ColumnValues;
    const [x, y, z] = [0, 1, 2].map((k) => (mean[k] - zero[k]) / diagonal);
    this.positionUniforms.origin.value.set(x, y, z);
    if (phi instanceof Float32Array) {
      multiply(phi, axes, this.products.image.data as unknown as Float32Array);
      this.products.needsUpdate = true;
      return;
    }
    const texels = this.cageTexture.image.data as unknown as Float32Array;
    for (const [k, axis] of axes.entries()) texels.set(axis, 4 * this.layout.blocks * k);
    this.cageTexture.needsUpdate = true;
  }

  private setOffsets({ before, after }: Pick<Pose, 'before' | 'after'>, weightBefore: number, weightAfter: number) {
    this.uploadOffsets(0, before);
    this.uploadOffsets(1, after);
    const weights = this.positionUniforms.offsetWeights.value;
    weights.set(before ? weightBefore / this.diagonal : 0, after ? weightAfter / this.diagonal : 0);
  }

  private uploadOffsets(which: 0 | 1, offsets: Offsets) {
    if (!offsets || this.shownOffsets[which] === offsets) return;
    this.shownOffsets[which] = offsets;
    (this.offsetTextures[which].image.data as unknown as Float32Array).set(offsets);
    this.offsetTextures[which].needsUpdate = true;
  }
}
