import { BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, Mesh, Points, Scene, Vector3 } from 'three';
import type { TriangleMesh } from '../../capture';
import { CageView } from '../../render/cageView';
import { PALE, SIGNED } from '../../render/colorMap';
import { colorTexture, ink, shaderMaterial } from '../../render/materials';
import { cageVertexShader, inkFragmentShader, modelFragmentShader, shapeVertexShader } from '../../render/sceneShaders';

/** What one view shows at one time. Positions are those of {@link RestPose}. */
export interface Drawing {
  readonly surface?: {
    readonly positions: Float32Array;
    /** Three points of each triangle; without any, the points are drawn. */
    readonly triangles: Uint32Array;
    /** Place of each point on the colour map, from 0 to 1. */
    readonly values?: Float32Array;
    /** Whether values lie on both sides of 0.5, which stands for zero. */
    readonly signed?: boolean;
    /** Whether faces are flat, as those of cages are. */
    readonly flat?: boolean;
  };
  /** Edges of a cage with these vertices. */
  readonly cage?: { readonly mesh: TriangleMesh; readonly vertices: Float32Array };
  /** Points that are marked; `through` says whether also where something hides them. */
  readonly marks?: { readonly positions: Float32Array; readonly through: boolean };
}

export interface DrawingColors {
  readonly model: Color;
  readonly solid: Color;
  readonly cage: Color;
  readonly edge: Color;
  readonly mark: Color;
}

/** A drawing on the graphics processor. Every later one has as many points, triangles and edges. */
export class DrawingScene {
  readonly scene = new Scene();
  private readonly surface: SurfaceView | null = null;
  private readonly cage: CageView | null = null;
  private readonly marks: MarksView | null = null;

  constructor(drawing: Drawing) {
    if (drawing.surface) this.scene.add((this.surface = new SurfaceView(drawing.surface)).mesh);
    if (drawing.cage) this.scene.add((this.cage = new CageView(drawing.cage.mesh)).group);
    if (drawing.marks) this.scene.add((this.marks = new MarksView(drawing.marks)).points);
    this.show(drawing);
  }

  show(drawing: Drawing) {
    if (drawing.surface) this.surface?.set(drawing.surface);
    if (drawing.cage) this.cage?.setVertices(drawing.cage.vertices);
  }

  setColors(colors: DrawingColors) {
    this.surface?.setColor(this.surface.flat ? colors.solid : colors.model);
    this.cage?.setColor(this.surface?.flat ? colors.edge : colors.cage);
    this.marks?.setColor(colors.mark);
  }

  /** Takes the vertical axis in the camera's space, pixels per unit one away, and pixels per CSS pixel. */
  setView(sky: Vector3, pixelsPerUnit: number, pixelRatio: number) {
    this.surface?.setView(sky, pixelsPerUnit);
    // In a view of some hundred pixels, dots as large as those of the viewer would hide the cage.
    this.cage?.setSizes(this.surface?.flat ? 0 : 0.5 * pixelRatio);
    this.marks?.setSize(5 * pixelRatio);
  }

  dispose() {
    this.surface?.dispose();
    this.cage?.dispose();
    this.marks?.dispose();
  }
}

class SurfaceView {
  readonly mesh: Mesh | Points;
  readonly flat: boolean;
  private readonly geometry = new BufferGeometry();
  private readonly uniforms;

  constructor({ positions, triangles, values, signed, flat }: NonNullable<Drawing['surface']>) {
    const isCloud = triangles.length === 0;
    this.flat = flat ?? false;
    this.geometry.setAttribute('position', new BufferAttribute(positions.slice(), 3).setUsage(DynamicDrawUsage));
    this.geometry.setAttribute('normal', new BufferAttribute(new Float32Array(positions.length), 3));
    this.geometry.setAttribute('heat', new BufferAttribute(new Float32Array(positions.length / 3), 1));
    this.uniforms = {
      color: { value: new Vector3() },
      hasColors: { value: false },
      skyDirection: { value: new Vector3(0, 1, 0) },
      heatColors: { value: colorTexture(signed ? SIGNED : PALE) },
      heatShare: { value: values ? 1 : 0 },
      asPoints: { value: isCloud },
      pointSize: { value: 1 },
    };
    // Edges of the same triangles are drawn before them.
    const behind = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    const material = shaderMaterial(shapeVertexShader, modelFragmentShader, this.uniforms, behind);
    if (!isCloud) this.geometry.setIndex(new BufferAttribute(triangles, 1));
    this.mesh = isCloud ? new Points(this.geometry, material) : new Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
  }

  set({ positions, values }: NonNullable<Drawing['surface']>) {
    this.put('position', positions);
    if (values) this.put('heat', values);
    // Without normals the shader takes those of the faces.
    if (!this.flat && this.mesh instanceof Mesh) this.geometry.computeVertexNormals();
  }

  setColor(color: Color) {
    this.uniforms.color.value.set(color.r, color.g, color.b);
  }

  setView(sky: Vector3, pixelsPerUnit: number) {
    this.uniforms.skyDirection.value.copy(sky);
    const points = this.geometry.getAttribute('position').count;
    this.uniforms.pointSize.value = Math.min(0.02, 1.1 / Math.sqrt(Math.max(1, points))) * pixelsPerUnit;
  }

  dispose() {
    this.geometry.dispose();
    this.uniforms.heatColors.value.dispose();
    (this.mesh.material as { dispose(): void }).dispose();
  }

  private put(name: string, values: Float32Array) {
    const attribute = this.geometry.getAttribute(name) as BufferAttribute;
    (attribute.array as Float32Array).set(values);
    attribute.needsUpdate = true;
  }
}

class MarksView {
  readonly points: Points;
  private readonly geometry = new BufferGeometry();
  private readonly uniforms;

  constructor({ positions, through }: NonNullable<Drawing['marks']>) {
    this.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.uniforms = {
      ink: { value: ink(new Color(), 1) },
      pointSize: { value: 1 },
      asPoints: { value: true },
      towards: { value: 0.004 },
    };
    const material = shaderMaterial(cageVertexShader, inkFragmentShader, this.uniforms, {
      transparent: true,
      depthWrite: false,
      depthTest: !through,
    });
    this.points = new Points(this.geometry, material);
    this.points.frustumCulled = false;
  }

  setColor(color: Color) {
    this.uniforms.ink.value = ink(color, 1);
  }

  setSize(pixels: number) {
    this.uniforms.pointSize.value = pixels;
  }

  dispose() {
    this.geometry.dispose();
    (this.points.material as { dispose(): void }).dispose();
  }
}
