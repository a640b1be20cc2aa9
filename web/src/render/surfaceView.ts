/** Parts and materials of a model, added to how it is drawn once they are there. It is loaded for captures that have any. */

import type { Mesh, Texture, WebGLRenderer } from 'three';
import type { Material, ModelSurface } from '../capture';
import { hasMaterials } from './hasMaterials';
import { MaterialView } from './materialView';
import type { ModelView } from './modelView';
import { drawGroups, PartedIndex } from './partedIndex';
import { MaterialPictures } from './pictures';

export class SurfaceView {
  /** Null where the model has no materials. */
  private readonly view: MaterialView | null;
  private readonly parted: readonly PartedIndex[];
  private readonly pictures = new MaterialPictures();
  private readonly materials: readonly Material[];

  /** @param caster casts the shadow with the geometry of the model's surface */
  constructor(
    private readonly renderer: WebGLRenderer,
    surface: ModelSurface,
    private readonly model: ModelView,
    caster: Mesh,
    positions: Texture,
  ) {
    const { parts, materials } = surface;
    this.materials = materials;
    this.view = hasMaterials(surface) ? new MaterialView(renderer, surface, model.uniforms, positions) : null;
    if (this.view) model.addMaterials(this.view.mesh);
    const drawn = [model.surface, model.wireframe, model.points] as const;
    // Where there is one part, everything is drawn at once as ever.
    this.parted = parts.length < 2 ? [] : drawn.map(({ geometry }, k) => new PartedIndex(geometry, 3 - k, parts));
    if (this.parted.length > 0) [...drawn, caster].forEach(drawGroups);
    this.showParts(parts.map(() => true));
  }

  showParts(shown: readonly boolean[]) {
    for (const index of this.parted) index.show(shown);
    this.view?.showParts(shown);
  }

  /** Takes files by their paths; gives those that no browser shows. */
  async setPictures(files: ReadonlyMap<string, Uint8Array<ArrayBuffer>>): Promise<string[]> {
    const { view, pictures } = this;
    if (!view || files.size === 0) return [];
    const gl = this.renderer.getContext();
    const limit = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    const refused = await pictures.load(files, this.materials, limit);
    view.setTextures((...what) => pictures.of(...what));
    return refused;
  }

  /** Says that the model has moved. */
  renew() {
    this.view?.renew();
  }

  /** To be called before the model is drawn. */
  prepare() {
    if (this.model.materials.visible) this.view?.prepare();
  }

  showPlaced(isPlaced: boolean) {
    this.view?.showPlaced(isPlaced);
  }

  dispose() {
    this.view?.dispose();
    this.pictures.dispose();
  }
}
