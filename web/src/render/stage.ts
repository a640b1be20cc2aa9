import {
  Color,
  Group,
  Matrix3,
  Matrix4,
  OrthographicCamera,
  PerspectiveCamera,
  Scene,
  Vector2,
  Vector3,
  type WebGLRenderer,
} from 'three';
import type { ModelSurface, StaticPart } from '../capture';
import type { Surface } from '../observed/surface';
import { boundsOf } from '../coordinates/topology';
import { Backdrop, Ground } from './ground';
import { CageView } from './cageView';
import { aim, aimParallel, cornersOf, FIELD_OF_VIEW, type CameraState } from './camera';
import { Decoder, type Pose } from './decoder';
import { type Covered, type Layers, type Side, type StageColors, drawSide } from './drawn';
import { ModelView } from './modelView';
import { ObservedView } from './observedView';
import { surfaceOf } from './surface';
import type { SurfaceView } from './surfaceView';
import { createRenderer, isSoftwareRendered } from './webgl';

/** Pictures that may show the same shadow where they must come fast. */
const SHADOW_EVERY = 6;
/** How far the ground is below the lowest point, in diagonals: what lies on it does not flicker. */
const CLEARANCE = 0.002;

/** Turns the model's axes to the scene's, whose y is up. */
const UPRIGHT = { y: new Matrix4(), z: new Matrix4().makeRotationX(-Math.PI / 2) } as const;

/** Draws one capture on a canvas: model, cage, ground and backdrop. Lengths in the scene are in units of the rest pose's diagonal. */
export class Stage {
  readonly decoder: Decoder;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly perspective = new PerspectiveCamera((FIELD_OF_VIEW * 180) / Math.PI, 1, 0.01, 100);
  private readonly parallel = new OrthographicCamera();
  /** The one of both that the last picture was drawn with. */
  private camera: PerspectiveCamera | OrthographicCamera = this.perspective;
  private readonly upright = new Group();
  private readonly model: ModelView;
  private readonly cage: CageView;
  private readonly ground: Ground;
  private readonly backdrop = new Backdrop();
  private readonly hasFaces: boolean;
  /** Parts and materials of the model, where it has any. */
  private surface: SurfaceView | null = null;
  private isDisposed = false;
  private observed: ObservedView | null = null;
  private observedColor = new Color();
  /** Pixels of the picture that something as large as its distance has, and those of a CSS pixel. */
  private pixels = { perUnit: 1, ratio: 1 };
  /** Vertices of the cage as it is shown, x y z each, in diagonals and in the model's axes. */
  readonly cageVertices: Float32Array;
  private side: Side = 'decoded';
  private split = 0.5;
  /** The part of the picture's width that nothing covers, in CSS pixels. */
  private free = { left: 0, width: 1 };
  private size = '';
  private shadowIsOld = true;
  private picturesWithShadow = 0;
  private pose: Pose | null = null;
  private grounded = false;
  private isAtRest = false;
  private isCageAlone = false;
  /** Whether something has changed since the last picture, which was drawn from {@link shownFrom}. */
  private pictureIsOld = true;
  private shownFrom: CameraState | null = null;
  /** Whether a change of its size has emptied the canvas, which had a picture. */
  wasEmptied = false;
  private up: 'y' | 'z' = 'y';
  private lowest = { y: Infinity, z: Infinity };

  /** Throws one sentence for a person where the browser or the device cannot draw this. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly capture: StaticPart,
  ) {
    this.renderer = createRenderer(canvas);
    const surface = surfaceOf(capture);
    this.hasFaces = surface.triangles.length > 0;
    this.decoder = new Decoder(this.renderer, capture, surface, isSoftwareRendered() ? 'page' : 'graphics');
    this.model = new ModelView(this.decoder, surface, capture.colors);
    this.cage = new CageView(capture.cage);
    this.ground = new Ground(this.decoder.positions, this.model.surface.geometry);
    this.cageVertices = new Float32Array(capture.cage.positions.length);
    this.upright.matrixAutoUpdate = false;
    this.upright.add(this.model.group, this.cage.group);
    this.scene.add(this.backdrop.mesh, this.upright, this.ground.mesh);
    this.showRest();
    canvas.addEventListener('webglcontextrestored', () => {
      this.isAtRest = false;
      this.surface?.renew();
      this.setPose(this.pose);
    });
  }

  /** Takes what is in diagonals and in the model's axes to the clip space of the picture that was drawn last. */
  get clipMatrix(): Matrix4 {
    const { projectionMatrix, matrixWorldInverse } = this.camera;
    return new Matrix4().multiplyMatrices(projectionMatrix, matrixWorldInverse).multiply(this.upright.matrix);
  }

  /** Has the next picture drawn even if nothing has changed that the stage knows of. */
  renew() {
    this.pictureIsOld = true;
  }

  /** Whether edges need a finer picture to look smooth. */
  get isJagged(): boolean {
    return !this.renderer.getContext().getContextAttributes()?.antialias;
  }

  setUp(axis: 'y' | 'z') {
    this.up = axis;
    this.pictureIsOld = true;
    this.upright.matrix.copy(UPRIGHT[axis]);
    this.upright.matrixWorldNeedsUpdate = true;
    this.grounded = this.isAtRest = false;
    this.setPose(this.pose);
  }

  /** Has the ground lie below the lowest places of all frames along the model's y and z axis, in diagonals. */
  layGround(y: number, z: number) {
    this.lowest = { y, z };
    this.lowerGround();
  }

  setLayers(layers: Layers) {
    this.pictureIsOld = true;
    const hasModel = !this.isCageAlone;
    this.model.showSurface(hasModel && layers.model && this.hasFaces, layers.materials);
    this.model.wireframe.visible = hasModel && layers.wireframe;
    this.model.points.visible = hasModel && (layers.points || (layers.model && !this.hasFaces));
    this.model.handles.visible = hasModel && layers.handles;
    this.model.showColors(layers.colors);
    this.cage.group.visible = layers.cage;
    this.ground.mesh.visible = layers.ground;
  }

  /** Shows cages without the model from now on, for captures whose Φ cannot be had. */
  hideModel() {
    this.isCageAlone = true;
    this.setPose(this.pose);
  }

  setColors(colors: StageColors) {
    this.pictureIsOld = true;
    this.observedColor = new Color(colors.handle);
    this.observed?.setColor(this.observedColor);
    this.backdrop.setColors(colors.top, colors.bottom);
    this.model.setColors(new Color(colors.model), new Color(colors.wire), 0.42, new Color(colors.handle));
    this.cage.setColor(new Color(colors.cage));
    this.ground.setColors(new Color(colors.grid), colors.shadow);
  }

  /** Takes the surface that the pose which is shown was recovered from, in the capture's unit; null for none. */
  setObserved(observed: Surface | null) {
    this.pictureIsOld = true;
    if (!observed) {
      if (this.observed) this.upright.remove(this.observed.group);
      this.observed?.dispose();
      this.observed = null;
      return;
    }
    if (!this.observed) {
      this.observed = new ObservedView(this.model.uniforms);
      this.upright.add(this.observed.group);
      this.observed.setColor(this.observedColor);
      this.observed.setSizes(this.pixels.perUnit, this.pixels.ratio);
    }
    const points = observed.points.slice();
    this.decoder.place(points);
    this.observed.set({ ...observed, points });
    this.setSide(this.side, this.split);
  }

  /** Takes the original of the pose that is shown, x y z of each point in the capture's unit. */
  setOriginal(positions: Float32Array) {
    this.decoder.placeFrame(positions);
    this.pictureIsOld = true;
  }

  /** Which side is drawn; the line between both is at `split`, a fraction of the width that nothing covers. */
  setSide(side: Side, split: number) {
    this.side = side;
    this.pictureIsOld = true;
    this.split = split;
    this.observed?.show(side);
    this.model.group.visible = !this.observed || side !== 'original';
  }

  /** Shows the model in colours of its points, red, green and blue each, in place of its own; null for its own again. */
  paint(colors: Uint8Array | null) {
    this.model.paint(colors);
    this.pictureIsOld = true;
  }

  /** Takes parts and materials of the model; what draws them is loaded when it is needed. */
  async setSurface(surface: ModelSurface): Promise<void> {
    const { SurfaceView } = await import('./surfaceView');
    if (this.isDisposed) return;
    this.surface = new SurfaceView(this.renderer, surface, this.model, this.ground.caster, this.decoder.positions);
    this.pictureIsOld = true;
  }

  /** Takes files of pictures for the materials; gives the paths of those that cannot be shown. */
  async setPictures(files: ReadonlyMap<string, Uint8Array<ArrayBuffer>>): Promise<string[]> {
    const refused = await this.surface?.setPictures(files);
    this.pictureIsOld = true;
    return refused ?? [];
  }

  /** Draws these parts of the model alone. */
  showParts(shown: readonly boolean[]) {
    this.surface?.showParts(shown);
    this.shadowIsOld = this.pictureIsOld = true;
  }

  setHandles(handles: Uint32Array) {
    this.model.setHandles(handles);
    this.pictureIsOld = true;
  }

  /** Colours the model by a value of each point, from 0 to `largest`; null for its own colour. */
  setHeat(values: Float32Array | null, largest: number) {
    this.model.setHeat(values, largest);
    this.pictureIsOld = true;
  }

  /** Colours the model by how far each point moves from one frame to the next, in diagonals. */
  setMotion(
    frames: Pick<Pose, 'before' | 'after'>,
    rowsBefore: Float32Array,
    rowsAfter: Float32Array,
    largest: number,
  ) {
    this.model.setHeat(this.decoder.decodeMotion(frames, rowsBefore, rowsAfter), largest);
    this.pictureIsOld = true;
  }

  /** Shows a pose, or the rest pose until Φ is there. */
  setPose(pose: Pose | null) {
    this.pose = pose;
    if (!pose || !(this.decoder.ready || this.isCageAlone)) {
      if (!this.isAtRest) this.showRest();
      return;
    }
    this.isAtRest = false;
    this.pictureIsOld = true;
    this.showCage(pose.rows);
    if (!this.decoder.ready) return;
    this.decoder.decode(pose);
    this.surface?.renew();
    this.shadowIsOld = true;
    if (this.grounded) return;
    this.grounded = true;
    const positions = this.decoder.readPositions();
    this.decoder.place(positions);
    this.putGroundBelow(positions);
  }

  /** Takes the size of the canvas in CSS pixels, and how much of it is covered: the rest shows what the camera looks at. */
  resize(width: number, height: number, pixelRatio: number, covered: Covered) {
    this.pictureIsOld = true;
    this.free = { left: covered.left, width: Math.max(1, width - covered.left - covered.right) };
    for (const camera of [this.perspective, this.parallel])
      camera.setViewOffset(
        width,
        height,
        (covered.right - covered.left) / 2,
        (covered.bottom - covered.top) / 2,
        width,
        height,
      );
    const size = `${width} ${height} ${pixelRatio}`;
    // Even an unchanged size would empty the canvas and make all its buffers anew.
    if (size === this.size) return;
    this.size = size;
    this.wasEmptied = this.shownFrom !== null;
    this.renderer.setPixelRatio(pixelRatio);
    this.renderer.setSize(Math.max(1, width), Math.max(1, height), false);
    this.perspective.aspect = Math.max(1, width) / Math.max(1, height);
    const { y: lines } = this.renderer.getDrawingBufferSize(new Vector2());
    this.pixels = { perUnit: lines / (2 * Math.tan(FIELD_OF_VIEW / 2)), ratio: pixelRatio };
    this.model.setSizes(this.pixels.perUnit, pixelRatio);
    this.observed?.setSizes(this.pixels.perUnit, pixelRatio);
    this.cage.setSizes(pixelRatio);
  }

  /** Draws a picture if it differs from the last one. Where pictures must come fast, the shadow follows the model only now and then. */
  draw(state: CameraState, hurried = false) {
    if (this.renderer.getContext().isContextLost()) return;
    if (!this.pictureIsOld && state === this.shownFrom) return;
    this.pictureIsOld = this.wasEmptied = false;
    this.shownFrom = state;
    if (state.isParallel) aimParallel(this.parallel, state, this.perspective.aspect);
    else aim(this.perspective, state);
    const camera = (this.camera = state.isParallel ? this.parallel : this.perspective);
    this.model.setSky(new Vector3(0, 1, 0).transformDirection(camera.matrixWorldInverse));
    const isDue = !hurried || ++this.picturesWithShadow >= SHADOW_EVERY;
    if (isDue && this.shadowIsOld && this.ground.mesh.visible && this.model.isSurfaceShown) {
      this.picturesWithShadow = 0;
      this.ground.castShadow(this.renderer, new Matrix3().setFromMatrix4(this.upright.matrix));
      this.shadowIsOld = false;
    }
    this.surface?.prepare();
    this.renderer.setRenderTarget(null);
    this.renderer.clear();
    const side = this.decoder.placedTextures && !this.observed ? this.side : 'decoded';
    const drawDecoded = () => this.renderer.render(this.scene, camera);
    const [drawOriginal, drawGhost] = [() => this.drawOriginal(), () => this.drawGhost()];
    drawSide(this.renderer, side, this.line, drawDecoded, drawOriginal, drawGhost);
  }

  /** Points, x y z each, in diagonals and in the model's axes, as they are in the scene. */
  inScene(points: ArrayLike<number>): Float64Array {
    const turned = Float64Array.from(points);
    const point = new Vector3();
    for (let k = 0; k < turned.length; k += 3)
      point.fromArray(turned, k).applyMatrix4(this.upright.matrix).toArray(turned, k);
    return turned;
  }

  restCorners(): Float64Array {
    const rest = Float32Array.from(this.capture.rest);
    this.decoder.place(rest);
    return cornersOf(boundsOf(this.inScene(rest)));
  }

  /** Where the line between both sides is, in CSS pixels from the left. */
  get line(): number {
    return this.free.left + this.split * this.free.width;
  }

  /** The share that has the line this many CSS pixels from the left. */
  splitAt(x: number): number {
    return (x - this.free.left) / this.free.width;
  }

  /** The same for a line through the middle of the model as it was drawn last. */
  get middleShare(): number {
    const { projectionMatrix, matrixWorldInverse } = this.camera;
    const { x } = this.ground.middle.clone().applyMatrix4(matrixWorldInverse).applyMatrix4(projectionMatrix);
    return this.splitAt((x / 2 + 0.5) * this.renderer.getSize(new Vector2()).x);
  }

  /** Has the ground and its shadow go along with the model, whose middle is at this place of the scene. */
  moveGround(middle: ArrayLike<number>) {
    const { x, z } = this.ground.middle;
    if (x === middle[0] && z === middle[2]) return;
    this.ground.middle.x = middle[0];
    this.ground.middle.z = middle[2];
    this.shadowIsOld = this.pictureIsOld = true;
  }

  dispose() {
    this.isDisposed = true;
    this.surface?.dispose();
    this.model.dispose();
    this.observed?.dispose();
    this.cage.dispose();
    this.ground.dispose();
    this.decoder.dispose();
    this.renderer.dispose();
  }

  /** The original has neither a cage nor handles. */
  private drawOriginal() {
    const [cage, handles] = [this.cage.group.visible, this.model.handles.visible];
    this.cage.group.visible = this.model.handles.visible = false;
    this.showPlaced(true);
    this.renderer.render(this.scene, this.camera);
    this.showPlaced(false);
    this.cage.group.visible = cage;
    this.model.handles.visible = handles;
  }

  private showPlaced(isPlaced: boolean) {
    this.model.showPlaced(isPlaced);
    this.surface?.showPlaced(isPlaced);
  }

  /** The original's surface, translucent over all that was drawn. */
  private drawGhost() {
    const shown = [this.backdrop.mesh, this.ground.mesh, this.cage.group].filter(({ visible }) => visible);
    for (const each of shown) each.visible = false;
    this.model.showPlaced(true);
    for (const pass of ['depth', 'ghost'] as const) {
      if (pass === 'depth') this.renderer.clearDepth();
      this.model.setPass(pass);
      this.renderer.render(this.scene, this.camera);
    }
    this.model.setPass(null);
    this.model.showPlaced(false);
    for (const each of shown) each.visible = true;
  }

  private showRest() {
    this.showCage(this.capture.cage.positions);
    this.decoder.showRest();
    this.isAtRest = true;
    this.shadowIsOld = this.pictureIsOld = true;
    if (this.grounded) return;
    const positions = Float32Array.from(this.capture.rest);
    this.decoder.place(positions);
    this.putGroundBelow(positions);
  }

  private showCage(vertices: ArrayLike<number>) {
    for (let k = 0; k < this.cageVertices.length; k++) this.cageVertices[k] = vertices[k];
    this.decoder.place(this.cageVertices);
    this.cage.setVertices(this.cageVertices);
  }

  private putGroundBelow(positions: Float32Array) {
    const { low, high } = boundsOf(this.inScene(positions));
    if (!Number.isFinite(low[1])) return;
    this.ground.middle.set((low[0] + high[0]) / 2, low[1] - CLEARANCE, (low[2] + high[2]) / 2);
    this.shadowIsOld = this.pictureIsOld = true;
    this.lowerGround();
  }

  private lowerGround() {
    const level = this.lowest[this.up] - CLEARANCE;
    if (level >= this.ground.middle.y) return;
    this.ground.middle.y = level;
    this.shadowIsOld = this.pictureIsOld = true;
  }
}
