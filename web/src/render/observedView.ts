import { BufferAttribute, BufferGeometry, Color, Group, Mesh, Points, type IUniform } from 'three';
import type { Surface } from '../observed/surface';
import type { Side } from './drawn';
import { ink, shaderMaterial } from './materials';
import { cageVertexShader, inkFragmentShader, modelFragmentShader, shapeVertexShader } from './sceneShaders';

const OPACITY = 0.4;

/** A surface that was observed: dots over the model, or alone in the model's light. */
export class ObservedView {
  readonly group = new Group();
  private readonly geometry = new BufferGeometry();
  private readonly ink = { value: ink(new Color(), OPACITY) };
  private readonly dotSize = { value: 1 };
  private readonly cloudSize = { value: 1 };
  private readonly dots: Points;
  private readonly faces: Mesh;
  /** Without an index, which would draw a point once for every corner. */
  private readonly cloud: Points;
  private side: Side = 'both';

  /** @param light what the model is shaded by, and its colour */
  constructor(light: Readonly<Record<string, IUniform>>) {
    const shaded = (asPoints: boolean) => {
      const own = { asPoints: { value: asPoints }, pointSize: this.cloudSize, heatShare: { value: 0 } };
      return shaderMaterial(shapeVertexShader, modelFragmentShader, { ...light, ...own });
    };
    this.cloud = new Points(new BufferGeometry(), shaded(true));
    this.dots = new Points(
      this.cloud.geometry,
      shaderMaterial(
        cageVertexShader,
        inkFragmentShader,
        { ink: this.ink, pointSize: this.dotSize, asPoints: { value: true }, towards: { value: 0.004 } },
        { transparent: true, depthWrite: false },
      ),
    );
    this.faces = new Mesh(this.geometry, shaded(false));
    this.group.add(this.dots, this.faces, this.cloud);
    for (const object of this.group.children) object.frustumCulled = false;
  }

  /** Points in the scene's unit. */
  set({ points, triangles }: Surface) {
    const places = new BufferAttribute(points, 3);
    this.geometry.dispose();
    this.geometry.setAttribute('position', places).setIndex(new BufferAttribute(triangles, 1));
    this.cloud.geometry.dispose();
    this.cloud.geometry.setAttribute('position', places);
    this.show(this.side);
  }

  show(side: Side) {
    this.side = side;
    const hasFaces = (this.geometry.index?.count ?? 0) > 0;
    this.dots.visible = side === 'both';
    this.faces.visible = side === 'original' && hasFaces;
    this.cloud.visible = side === 'original' && !hasFaces;
  }

  setColor(color: Color) {
    this.ink.value = ink(color, OPACITY);
  }

  setSizes(pixelsPerUnit: number, pixelRatio: number) {
    this.dotSize.value = 1.7 * pixelRatio;
    this.cloudSize.value = 0.008 * pixelsPerUnit;
  }

  dispose() {
    this.geometry.dispose();
    this.cloud.geometry.dispose();
    for (const { material } of [this.dots, this.faces, this.cloud]) (material as { dispose(): void }).dispose();
  }
}
