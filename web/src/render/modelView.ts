import {
  Group,
  LineSegments,
  Mesh,
  Points,
  type Color,
  type DataTexture,
  type Material,
  type Texture,
  type Vector3,
} from 'three';
import { pointColorTexture, pointValueTexture } from './dataTextures';
import type { Decoder } from './decoder';
import { ink, modelUniforms, numberedGeometry, shaderMaterial } from './materials';
import { inkFragmentShader, modelFragmentShader, modelVertexShader } from './sceneShaders';
import type { Surface } from './surface';

/** How much of what is decoded shows through the original that is drawn over it. */
const GHOST_TRANSPARENCY = 0.55;

/** The model as surface, wireframe, points and handles, all placed by the decoder's textures. */
export class ModelView {
  readonly group = new Group();
  readonly surface: Mesh;
  readonly wireframe: LineSegments;
  readonly points: Points;
  readonly handles: Points;
  /** What it is shaded by, and its colour. */
  readonly uniforms = modelUniforms();
  private readonly cloudSize = { value: 1 };
  private readonly wireInk = { value: ink(this.uniforms.color.value, 0.5) };
  private readonly handleInk = { value: ink(this.uniforms.color.value, 1) };
  private readonly handleSize = { value: 1 };
  private heat: DataTexture | null = null;
  private hasHeat = false;
  private colors: DataTexture | null = null;
  private showsColors = true;
  private isPainted = false;
  /** The surface in its materials, where the model has any. */
  readonly materials = new Group();
  isSurfaceShown = true;
  private showsMaterials = true;
  private isGhost = false;

  /** @param ownColors red, green and blue of each point, in sRGB */
  constructor(
    private readonly decoder: Decoder,
    surface: Surface,
    private readonly ownColors: Uint8Array | undefined,
  ) {
    const uniforms = this.uniforms as Record<string, { value: unknown }>;
    uniforms.positions.value = decoder.positions satisfies Texture;
    uniforms.normals.value = decoder.normals;
    const all = Uint32Array.from({ length: decoder.points }, (_, p) => p);
    const still = { towards: { value: 0 }, asPoints: { value: false }, pointSize: { value: 1 } };
    const shaded = (own: Record<string, { value: unknown }>) =>
      shaderMaterial(modelVertexShader, modelFragmentShader, { ...uniforms, ...still, ...own });
    const drawn = (own: Record<string, { value: unknown }>) =>
      shaderMaterial(
        modelVertexShader,
        inkFragmentShader,
        { ...uniforms, ...still, ...own },
        { transparent: true, depthWrite: false },
      );
    this.surface = new Mesh(numberedGeometry(surface.triangles), shaded({}));
    this.wireframe = new LineSegments(
      numberedGeometry(surface.edges),
      drawn({ towards: { value: 0.0012 }, ink: this.wireInk }),
    );
    this.points = new Points(numberedGeometry(all), shaded({ asPoints: { value: true }, pointSize: this.cloudSize }));
    this.handles = new Points(
      numberedGeometry(new Uint32Array(0)),
      drawn({ towards: { value: 0.004 }, asPoints: { value: true }, pointSize: this.handleSize, ink: this.handleInk }),
    );
    this.group.add(this.surface, this.materials, this.points, this.wireframe, this.handles);
    for (const object of [this.surface, this.points, this.wireframe, this.handles]) object.frustumCulled = false;
    this.paint(null);
  }

  setHandles(handles: Uint32Array) {
    this.handles.geometry.dispose();
    this.handles.geometry = numberedGeometry(handles.filter((point) => point < this.decoder.points));
  }

  /**
   * Colours the model by a value of each point, from 0 to `largest`: numbers, or a texture whose vectors have these lengths. Null for its own
   * colour.
   */
  setHeat(values: Float32Array | Texture | null, largest: number) {
    this.heat?.dispose();
    this.heat = values instanceof Float32Array ? pointValueTexture(values, this.decoder.bands) : null;
    (this.uniforms.heat as { value: unknown }).value = this.heat ?? values;
    this.uniforms.heatScale.value = largest > 0 ? 1 / largest : 0;
    this.hasHeat = values !== null;
    this.uniforms.heatShare.value = this.hasHeat ? 1 : 0;
    this.arrange();
  }

  /** Takes what draws the surface in its materials. */
  addMaterials(mesh: Mesh) {
    this.materials.add(mesh);
    this.arrange();
  }

  /** Shows the surface or not; in its materials, if it is to be and has any, where no colours stand for something else. */
  showSurface(isShown: boolean, inMaterials: boolean) {
    this.isSurfaceShown = isShown;
    this.showsMaterials = inMaterials;
    this.arrange();
  }

  /** Shows the model in the colours of its points where it has any, or in one colour. */
  showColors(isShown: boolean) {
    this.showsColors = isShown;
    this.uniforms.hasColors.value = isShown && this.colors !== null;
  }

  /** Takes colours in place of those that the points have; null for these again. */
  paint(colors: Uint8Array | null) {
    this.colors?.dispose();
    const taken = colors ?? this.ownColors;
    this.isPainted = colors !== null;
    this.colors = taken ? pointColorTexture(taken, this.decoder.bands) : null;
    (this.uniforms.colors as { value: unknown }).value = this.colors;
    this.showColors(this.showsColors);
    this.arrange();
  }

  /** Shows the frame that the decoder was given as positions, in the model's own colour; or what it decoded. */
  showPlaced(isPlaced: boolean) {
    const placed = isPlaced ? this.decoder.placedTextures : null;
    const uniforms = this.uniforms as Record<string, { value: unknown }>;
    uniforms.positions.value = placed?.positions ?? this.decoder.positions;
    uniforms.normals.value = placed?.normals ?? this.decoder.normals;
    this.uniforms.heatShare.value = this.hasHeat && !placed ? 1 : 0;
  }

  /** Draws the surface as a ghost: its depth first, so that only its front is blended with the picture; null draws the model as ever. */
  setPass(pass: 'depth' | 'ghost' | null) {
    this.wireframe.layers.mask = this.handles.layers.mask = pass ? 0 : 1;
    this.uniforms.transparency.value = pass ? GHOST_TRANSPARENCY : 0;
    for (const material of [this.surface, this.points].flatMap(materialsOf)) {
      material.colorWrite = pass !== 'depth';
      material.transparent = pass === 'ghost';
    }
    this.isGhost = pass !== null;
    this.arrange();
  }

  private arrange() {
    const hasMaterials = this.materials.children.length > 0 && !this.hasHeat && !this.isPainted && !this.isGhost;
    this.materials.visible = this.isSurfaceShown && this.showsMaterials && hasMaterials;
    this.surface.visible = this.isSurfaceShown && !this.materials.visible;
  }

  setColors(model: Color, wire: Color, wireOpacity: number, handle: Color) {
    this.uniforms.color.value.copy(model);
    this.wireInk.value = ink(wire, wireOpacity);
    this.handleInk.value = ink(handle, 0.95);
  }

  /** Sizes in pixels of the picture: of a point one diagonal away that is as large as the distance between points, and of a handle one away. */
  setSizes(pixelsPerUnit: number, pixelRatio: number) {
    const spacing = 1.1 / Math.sqrt(Math.max(1, this.decoder.points));
    this.cloudSize.value = Math.min(0.02, spacing) * pixelsPerUnit;
    this.handleSize.value = 0.0085 * pixelsPerUnit + pixelRatio;
  }

  /** The vertical axis, in the camera's space. */
  setSky(direction: Vector3) {
    this.uniforms.skyDirection.value.copy(direction);
  }

  dispose() {
    for (const object of [this.surface, this.wireframe, this.points, this.handles]) {
      object.geometry.dispose();
      for (const material of materialsOf(object)) material.dispose();
    }
    this.uniforms.heatColors.value.dispose();
    this.heat?.dispose();
    this.colors?.dispose();
  }
}

/** One, or several where parts are drawn by themselves. */
export function materialsOf({ material }: { readonly material: Material | Material[] }): Material[] {
  return [material].flat();
}
