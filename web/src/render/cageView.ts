import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  GreaterDepth,
  Group,
  LineSegments,
  Points,
  type RawShaderMaterial,
  Color,
} from 'three';
import type { TriangleMesh } from '../capture';
import { polygonsOf } from '../codec/polygons';
import { ink, shaderMaterial } from './materials';
import { cageVertexShader, inkFragmentShader } from './sceneShaders';
import { edgesOf } from './surface';

/** The cage: edges and vertices; what the model hides shows faintly. */
export class CageView {
  readonly group = new Group();
  private readonly places: BufferAttribute;
  private readonly lineInk = { value: ink(new Color(), 1) };
  private readonly hiddenInk = { value: ink(new Color(), 1) };
  private readonly dotInk = { value: ink(new Color(), 1) };
  private readonly dotSize = { value: 4 };
  private readonly geometry = new BufferGeometry();
  private readonly dots = new BufferGeometry();
  private readonly materials: RawShaderMaterial[] = [];

  constructor(cage: TriangleMesh) {
    const { positions, triangles } = cage;
    this.places = new BufferAttribute(new Float32Array(positions.length), 3).setUsage(DynamicDrawUsage);
    this.geometry.setAttribute('position', this.places);
    this.geometry.setIndex(new BufferAttribute(edgesOf(polygonsOf(triangles), positions.length / 3), 1));
    this.dots.setAttribute('position', this.places);
    const drawn = (uniforms: Record<string, { value: unknown }>, hidden = false) => {
      const material = shaderMaterial(
        cageVertexShader,
        inkFragmentShader,
        { pointSize: this.dotSize, asPoints: { value: false }, towards: { value: 0 }, ...uniforms },
        { transparent: true, depthWrite: false, ...(hidden ? { depthFunc: GreaterDepth } : {}) },
      );
      this.materials.push(material);
      return material;
    };
    this.group.add(
      new LineSegments(this.geometry, drawn({ ink: this.hiddenInk }, true)),
      new LineSegments(this.geometry, drawn({ ink: this.lineInk })),
      new Points(this.dots, drawn({ ink: this.dotInk, asPoints: { value: true }, towards: { value: 0.002 } })),
    );
    for (const object of this.group.children) object.frustumCulled = false;
  }

  /** Vertices of the cage, x y z each, in the scene's unit. */
  setVertices(positions: Float32Array) {
    (this.places.array as Float32Array).set(positions.subarray(0, this.places.array.length));
    this.places.needsUpdate = true;
  }

  setColor(color: Color) {
    this.lineInk.value = ink(color, 0.62);
    this.hiddenInk.value = ink(color, 0.13);
    this.dotInk.value = ink(color, 1);
  }

  setSizes(pixelRatio: number) {
    this.dotSize.value = 5 * pixelRatio;
  }

  dispose() {
    this.geometry.dispose();
    this.dots.dispose();
    for (const material of this.materials) material.dispose();
  }
}
