import {
  BufferAttribute,
  BufferGeometry,
  DataTexture,
  Mesh,
  type RawShaderMaterial,
  type Texture,
  type WebGLRenderer,
} from 'three';
import type { Material, ModelSurface, TextureChannel } from '../capture';
import type { TriangleRange } from '../codec/surface/splitMesh';
import { CornerNormals } from './cornerNormals';
import { shaderMaterial, type modelUniforms } from './materials';
import { materialFragmentShader, materialVertexShader } from './materialShaders';
import { showRanges } from './partedIndex';

/** Faces without a material look like this. */
const PLAIN: Material = {
  name: '',
  baseColor: [0.8, 0.8, 0.8],
  opacity: 1,
  roughness: 0.5,
  metalness: 0,
  textures: [],
};

/** Channels in the order of `hasMaps`, and the textures that they have in the shader. */
const MAPS: readonly (readonly [TextureChannel, string])[] = [
  ['base_color', 'baseMap'],
  ['opacity', 'opacityMap'],
  ['roughness', 'roughnessMap'],
  ['metalness', 'metalnessMap'],
];

/** A picture as the graphics processor has it, and whether it has an alpha channel. */
export interface MaterialTexture {
  readonly texture: Texture;
  readonly hasAlpha: boolean;
}

/** The model's surface in its materials. */
export class MaterialView {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial[]>;
  private readonly ranges: readonly (TriangleRange & { readonly drawn: number })[];
  private readonly looks: { readonly material: Material; readonly tile: number }[] = [];
  private readonly normals: CornerNormals | null;
  private readonly hasSplitNormals = { value: false };
  private readonly blank = new DataTexture(new Uint8Array(4).fill(255), 1, 1);
  private normalsAreOld = true;

  constructor(
    renderer: WebGLRenderer,
    { mesh, materials, parts }: ModelSurface,
    private readonly shared: Pick<ReturnType<typeof modelUniforms>, 'positions' | 'normals' | 'skyDirection'>,
    positions: Texture,
  ) {
    this.normals = mesh.split && new CornerNormals(renderer, mesh.split, positions);
    this.blank.needsUpdate = true;
    const geometry = new BufferGeometry().setIndex(new BufferAttribute(mesh.triangles, 1));
    geometry.setAttribute('point', new BufferAttribute(mesh.points, 1));
    geometry.setAttribute('normalAt', new BufferAttribute(mesh.normals, 1));
    geometry.setAttribute('uv', new BufferAttribute(mesh.uvs, 2));
    this.ranges = mesh.ranges.map((range) => ({ ...range, drawn: this.lookOf(range, materials) }));
    this.mesh = new Mesh(
      geometry,
      this.looks.map(({ material }) => this.materialOf(material)),
    );
    this.mesh.frustumCulled = false;
    this.showPlaced(false);
    this.showParts(parts.map(() => true));
  }

  showParts(shown: readonly boolean[]) {
    showRanges(this.mesh.geometry, this.ranges, shown, ({ drawn }) => drawn);
  }

  /** Says that the model has moved. */
  renew() {
    this.normalsAreOld = true;
  }

  /** To be called before it is drawn. */
  prepare() {
    if (!this.normalsAreOld) return;
    this.normalsAreOld = false;
    this.normals?.compute();
  }

  /** Frames that are given as positions have one normal at each point. */
  showPlaced(isPlaced: boolean) {
    this.hasSplitNormals.value = this.normals !== null && !isPlaced;
  }

  /** Takes pictures in place of numbers: `textureOf` gives that of a channel, where it is there. */
  setTextures(textureOf: (material: Material, channel: TextureChannel, tile: number) => MaterialTexture | null) {
    this.looks.forEach(({ material, tile }, k) => {
      const { uniforms } = this.mesh.material[k];
      const found = MAPS.map(([channel]) => textureOf(material, channel, tile));
      uniforms.hasMaps.value = found.map((map) => map !== null);
      MAPS.forEach(([, name], map) => (uniforms[name].value = found[map]?.texture ?? this.blank));
      uniforms.opacityIsAlpha.value = found[1]?.hasAlpha ?? false;
      // A picture cuts out; a number is the same everywhere, so that order matters little.
      this.blend(this.mesh.material[k], found[1] === null && material.opacity < 1);
    });
  }

  dispose() {
    this.mesh.geometry.dispose();
    for (const material of this.mesh.material) material.dispose();
    this.normals?.dispose();
    this.blank.dispose();
  }

  /** The place of what a range looks like in the list of all. */
  private lookOf({ material: number, tile }: TriangleRange, materials: readonly Material[]): number {
    const material = number > 0 ? materials[number - 1] : PLAIN;
    const known = this.looks.findIndex((look) => look.material === material && look.tile === tile);
    return known >= 0 ? known : this.looks.push({ material, tile }) - 1;
  }

  private materialOf({ baseColor, opacity, roughness, metalness }: Material): RawShaderMaterial {
    const maps = Object.fromEntries(MAPS.map(([, name]) => [name, { value: this.blank }]));
    const material = shaderMaterial(materialVertexShader, materialFragmentShader, {
      ...this.shared,
      ...maps,
      splitNormals: { value: this.normals?.texture ?? this.blank },
      hasSplitNormals: this.hasSplitNormals,
      baseColor: { value: baseColor },
      opacity: { value: opacity },
      roughness: { value: roughness },
      metalness: { value: metalness },
      hasMaps: { value: [false, false, false, false] },
      opacityIsAlpha: { value: false },
    });
    this.blend(material, opacity < 1);
    return material;
  }

  private blend(material: RawShaderMaterial, isBlended: boolean) {
    material.transparent = isBlended;
    material.depthWrite = !isBlended;
  }
}
