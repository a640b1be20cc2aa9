import { Color, Mesh } from 'three';
import { numberedGeometry, shaderMaterial } from './materials';
import { BACKDROP_SQUARES, backdropFragmentShader, backdropVertexShader } from './sceneShaders';

/** What is behind everything: one colour that passes into another from top to bottom. */
export class Backdrop {
  readonly mesh: Mesh;
  private readonly colors = { top: { value: new Color() }, bottom: { value: new Color() } };

  constructor() {
    this.mesh = new Mesh(
      numberedGeometry(gridTriangles(BACKDROP_SQUARES)),
      shaderMaterial(backdropVertexShader, backdropFragmentShader, this.colors, {
        depthTest: false,
        depthWrite: false,
      }),
    );
    this.mesh.frustumCulled = false;
  }

  /** Takes CSS colours in sRGB. */
  setColors(top: string, bottom: string) {
    this.colors.top.value.set(top).convertLinearToSRGB();
    this.colors.bottom.value.set(bottom).convertLinearToSRGB();
  }
}

/** Triangles of a square of so many squares along a side; vertices are numbered row by row. */
function gridTriangles(squares: number): Uint32Array {
  const corners = [0, 1, squares + 1, squares + 1, 1, squares + 2];
  return Uint32Array.from({ length: 6 * squares * squares }, (_, k) => {
    const square = Math.floor(k / 6);
    return square + Math.floor(square / squares) + corners[k % 6];
  });
}
