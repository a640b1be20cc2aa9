import type { Capture, FrameBlock, UpAxis } from '../capture';
import { canCompute } from '../coordinates/compute';
import { computePhi } from '../coordinates/pool';
import { framed, HOME, nearlySame, shifted, zoomed, type CameraState } from '../render/camera';
import { CameraControls } from '../render/cameraControls';
import type { Covered, Layers } from '../render/drawn';
import type { FrameEdit } from '../render/frameStore';
import { Motion, surveyMotion } from '../render/motion';
import { Stage } from '../render/stage';
import type { Comparison } from './comparison';
import type { Heat, HeatMap, HeatRange } from './heatMap';
import { Playback } from './playback';
import { PlayedSurface } from './playedSurface';
import { Quality, Resolution } from './quality';
import { sentence } from '../text';
import { advanced, type Transport } from './transport';
import { USUAL_LAYERS } from './viewState';

/** What is being done before the model can be seen; the fraction is null where nobody knows it. */
export interface Progress {
  readonly doing: string;
  readonly fraction: number | null;
}

/** Longest step of the clock: a tab that was hidden goes on where it was. */
const LONGEST_STEP = 0.1;
/** A camera that sees all of the motion is no more times as far as one that follows the model; else it begins to follow. */
const FARTHEST = 2.5;
/** Between looks whether frames have come that a picture needs. */
const WAIT_MILLISECONDS = 20;
/** Seconds before and after a frame over which the way of a camera that follows is smoothed. */
const FOLLOW_SECONDS = 0.5;

/** Plays one capture on a canvas: clock, frames, decoding and camera. The element around it shows the controls. */
export class Player {
  /** Called after every picture, with the place in the capture. */
  onTick: (position: number) => void = () => undefined;
  /** Called when anything but the place has changed. */
  onState: () => void = () => undefined;
  /** Called when something went wrong, with one sentence; with null when it is over. */
  onProblem: (problem: string | null) => void = () => undefined;
  /** Called when what a sentence said is over. */
  onRecovery: (problem: string) => void = () => undefined;
  readonly stage: Stage;
  readonly controls: CameraControls;
  readonly resolution: Resolution;
  progress: Progress | null = null;
  readonly playback: Playback;
  readonly heatMap: HeatMap;
  readonly comparison: Comparison;
  private readonly motion: Motion;
  /** The camera that frames the motion as it was known last, whether it does so from the usual side, and whether no more was known than the rest pose. */
  private fitted: CameraState | null = null;
  private fitsFromHome = false;
  private fitsRest = true;
  private follows = false;
  /** Whether somebody chose that the camera follows the model, or that it does not; null where the motion decides. */
  followChoice: boolean | null = null;
  private isSurveyed = false;
  private readonly stop = new AbortController();
  private shownLayers = USUAL_LAYERS;
  private scheduled = 0;
  private lastTick = 0;
  private isMoving = false;
  /** Whether Φ is there, or will never be. */
  private isPrepared = false;
  private readonly quality: Quality;
  private upAxis: UpAxis = 'y';
  /** Parts and materials, which come after the model. */
  readonly surface: PlayedSurface;

  /**
   * Throws one sentence for a person where the browser cannot draw the capture.
   *
   * @param lead the player whose place and camera this one follows; without it, this one has its own
   */
  constructor(
    canvas: HTMLCanvasElement,
    readonly capture: Capture,
    private readonly lead: Player | null = null,
  ) {
    this.stage = new Stage(canvas, capture.static);
    this.quality = new Quality(this.stage.isJagged);
    this.resolution = new Resolution(this.stage);
    this.controls = new CameraControls(canvas);
    this.controls.onMove = () => this.wake();
    const { rowsPerFrame, cage, rest } = capture.static;
    this.motion = new Motion(rowsPerFrame, cage.positions.length / 3, rest, this.stage.decoder);
    this.motion.onGrowth = () => {
      this.stage.layGround(...this.motion.lowest);
      this.followTravel();
      this.refit();
      this.heatMap.grow();
    };
    this.playback = new Playback(capture, this.stage, this.motion, {
      arrived: (block) => this.include(block),
      wake: () => this.wake(),
      refresh: () => this.refresh(),
      changed: () => this.onState(),
      problem: (problem) => this.onProblem(problem),
      recovered: (problem) => this.onRecovery(problem),
    });
    this.surface = new PlayedSurface(capture, this.stage, {
      refresh: () => this.refresh(),
      problem: (problem) => this.onProblem(problem),
    });
    this.heatMap = this.playback.heatMap;
    this.comparison = this.playback.comparison;
    capture.events.addEventListener('change', () => this.playback.followCapture(), { signal: this.stop.signal });
    canvas.addEventListener('webglcontextlost', (event) => this.loseContext(event), { signal: this.stop.signal });
    canvas.addEventListener('webglcontextrestored', () => this.regainContext(), { signal: this.stop.signal });
    this.stage.setLayers(this.shownLayers);
    void this.prepare();
  }

  get transport(): Transport {
    return this.playback.transport;
  }

  set transport(transport: Transport) {
    this.playback.go(transport);
    this.onState();
    this.wake();
  }

  get picturesPerSecond(): number {
    return this.quality.picturesPerSecond;
  }

  get layers(): Layers {
    return this.shownLayers;
  }

  set layers(layers: Layers) {
    this.shownLayers = layers;
    this.stage.setLayers(layers);
    if (layers.handles) void this.fetchHandles();
    this.refresh();
  }

  get up(): UpAxis {
    return this.upAxis;
  }

  setUp(axis: UpAxis) {
    this.upAxis = axis;
    this.stage.setUp(axis);
    this.refresh();
  }

  setHeat(heat: Heat, range: HeatRange = this.heatMap.range) {
    this.heatMap.show(heat, range);
    this.refresh();
  }

  /** Shows frames with other rows than the capture has: `edit` gives those of a frame. Null shows the capture itself. */
  setFrameEdit(edit: FrameEdit | null) {
    this.playback.setFrameEdit(edit);
    // Movement is that of the frames as they are shown.
    this.setHeat(this.heatMap.kind);
  }

  /** Draws a cage with these rows, `rowsPerFrame × 3`, in place of those of frames; null draws frames as they are. */
  deform(rows: Float64Array | null) {
    if (rows === this.playback.shape) return;
    this.playback.shape = rows;
    this.refresh();
  }

  /** Frames the model in all frames that are known, from the side the camera is on; relative to its middle where the camera follows it. */
  frameAll(from: CameraState = this.controls.destination, atOnce = false) {
    this.fitsRest = this.motion.isEmpty;
    const camera = this.framing(from, this.follows);
    this.fitsFromHome = false;
    if (this.fitted && this.controls.destination === this.fitted && nearlySame(camera, this.fitted)) return;
    this.fitted = camera;
    this.controls.go(camera, atOnce);
  }

  /** The camera that frames all motion, seen from the side of another camera. */
  private framing(from: CameraState, follows: boolean): CameraState {
    const { clientWidth, clientHeight } = this.stage.canvas;
    const { top, right, bottom, left } = this.resolution.covered;
    const free = Math.max(1, clientHeight - top - bottom);
    const corners = this.motion.isEmpty
      ? this.stage.restCorners()
      : this.stage.inScene(this.motion.corners(follows ? this.followReach : null));
    const fitting = framed(from, corners, Math.max(1, clientWidth - right - left) / free);
    return zoomed(fitting, clientHeight / free);
  }

  /** Looks with perspective or without it from where the camera is. */
  setParallel(isParallel: boolean) {
    this.controls.go({ ...this.controls.destination, isParallel }, true);
    this.onState();
  }

  goHome(atOnce = false) {
    this.frameAll(HOME, atOnce);
    this.fitsFromHome = true;
    this.followTravel();
  }

  /** Whether the camera frames the motion from the usual side, as nobody has moved it. */
  get isHome(): boolean {
    return this.fitsFromHome && this.controls.destination === this.fitted;
  }

  get isFollowing(): boolean {
    return this.follows;
  }

  /** Has the camera follow the model or not; null where the motion is to decide. */
  chooseFollowing(choice: boolean | null) {
    this.followChoice = choice;
    this.setFollowing(choice ?? false);
    this.followTravel();
  }

  /** Begins to follow a model that goes so far that little could be seen of it, unless somebody has chosen otherwise, or moved the camera. */
  private followTravel() {
    if (this.follows || this.followChoice !== null || this.lead || !this.isHome || this.motion.isEmpty) return;
    const [all, near] = [false, true].map((follows) => this.framing(HOME, follows).distance);
    if (all > FARTHEST * near) this.setFollowing(true);
  }

  private setFollowing(follows: boolean) {
    if (follows === this.follows) return;
    const wasFitted = this.controls.destination === this.fitted;
    const { isHome } = this;
    const centre = this.centre();
    this.follows = follows;
    this.controls.go(shifted(this.controls.destination, follows ? centre.map((value) => -value) : centre), true);
    if (wasFitted) this.frameAll(isHome ? HOME : undefined);
    this.fitsFromHome = isHome;
    this.refresh();
  }

  /** The camera of the picture: that of the controls, beside the model where it follows it. */
  get camera(): CameraState {
    if (this.lead) return this.lead.camera;
    const { camera } = this.controls;
    return this.follows ? shifted(camera, this.centre()) : camera;
  }

  /** Takes the size of the canvas in CSS pixels, and how much of it is covered. */
  resize(width: number, height: number, pixelRatio: number, covered: Covered) {
    this.resolution.resize(width, height, pixelRatio, covered, this.isMoving ? this.quality.moving : this.resting);
    if (this.stage.wasEmptied) this.draw();
    this.wake();
  }

  refresh() {
    this.playback.poseIsOld = true;
    this.stage.renew();
    this.onState();
    this.wake();
  }

  /** Positions of a frame as the graphics processor decodes them, x y z of each point in the capture's unit. */
  async readPositions(frame: number): Promise<Float32Array> {
    if (!this.stage.decoder.ready) throw new Error('The model is not ready yet; wait until it is shown.');
    const { rows, offsets } = await this.playback.frame(frame);
    this.stage.setPose({ rows, before: offsets, after: null, mix: 0 });
    const positions = this.stage.decoder.readPositions();
    this.refresh();
    return positions;
  }

  /** Shows a place exactly, as soon as its frames are here; the picture is drawn by {@link drawn}. */
  async stand(place: Transport, signal: AbortSignal) {
    for (;;) {
      this.playback.follow({ ...place, playing: false });
      if (!this.playback.buffering) break;
      await new Promise((resolve) => setTimeout(resolve, WAIT_MILLISECONDS));
      signal.throwIfAborted();
      this.stop.signal.throwIfAborted();
    }
    if (!this.motion.isEmpty) this.stage.moveGround(this.centre());
  }

  /** The canvas with its picture, which lasts until the browser shows it. */
  drawn(): HTMLCanvasElement {
    this.stage.renew();
    this.draw();
    return this.stage.canvas;
  }

  /** The picture as a file has it: the finest, with the model in its middle whatever floats above the canvas. */
  picture(): Promise<Blob> {
    const { resolution } = this;
    const { isForFile } = resolution;
    resolution.isForFile = true;
    const canvas = this.drawn();
    const picture = new Promise<Blob>((resolve, reject) => {
      canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('The image could not be saved.'))));
    });
    resolution.isForFile = isForFile;
    // What the file has is taken already.
    this.drawn();
    return picture;
  }

  dispose() {
    this.stop.abort();
    cancelAnimationFrame(this.scheduled);
    this.controls.dispose();
    this.playback.close();
    this.stage.dispose();
  }

  private async prepare() {
    const { signal } = this.stop;
    const { capture } = this;
    try {
      // What the page cannot compute comes from the service.
      const isFetched = !canCompute(capture.static.system) && capture.coordinates !== undefined;
      const doing = isFetched ? 'Loading model' : 'Preparing model';
      const onProgress = (fraction: number) => this.report({ doing, fraction });
      onProgress(0);
      const phi = isFetched
        ? await capture.coordinates!(onProgress, signal)
        : await (capture.phi?.(onProgress, signal) ?? computePhi(capture.static, { signal, onProgress }));
      await this.stage.decoder.setPhi(phi);
      signal.throwIfAborted();
      this.motion.setPhi(phi);
    } catch (error) {
      if (signal.aborted) return;
      // The cage can still be looked at.
      this.stage.hideModel();
      this.motion.setPhi(null);
      this.layers = { ...this.shownLayers, cage: true };
      this.onProblem(sentence(error));
    }
    this.isPrepared = true;
    this.report(null);
    this.refresh();
    await this.surface.load(this.stop.signal);
  }

  private async fetchHandles() {
    try {
      const handles = await this.capture.handles?.(this.stop.signal);
      if (handles) this.stage.setHandles(handles);
      this.refresh();
    } catch (error) {
      if (!this.stop.signal.aborted) this.onProblem(sentence(error));
    }
  }

  private report(progress: Progress | null) {
    this.progress = progress;
    this.onState();
  }

  private wake() {
    if (this.lead) {
      this.lead.wake();
      return;
    }
    if (this.stop.signal.aborted || this.scheduled !== 0) return;
    this.scheduled = requestAnimationFrame((now) => this.tick(now));
  }

  /** How fine pictures are at rest: less so where drawing them would take the processor from Φ. */
  private get resting(): number {
    return this.isPrepared || !this.stage.isJagged ? 1 : 0.5;
  }

  private tick(now: number) {
    this.scheduled = 0;
    const { playback } = this;
    const sinceLast = this.lastTick === 0 ? 0 : (now - this.lastTick) / 1000;
    const seconds = Math.min(LONGEST_STEP, sinceLast);
    const turned = this.controls.advance(seconds);
    const waited = playback.buffering;
    // While Φ is computed, pictures would take the processor from it.
    playback.moveTo(this.isPrepared ? advanced(playback.transport, seconds) : playback.transport);
    const { playing, frames, position } = playback.transport;
    const wasMoving = this.isMoving;
    this.isMoving = turned || (playing && frames > 1 && this.isPrepared);
    if (this.isMoving && wasMoving) this.quality.measure(sinceLast);
    // Pictures become fine again one picture after everything has come to rest.
    this.resolution.share = this.isMoving || wasMoving ? this.quality.moving : this.resting;
    if (!this.motion.isEmpty) this.stage.moveGround(this.centre());
    this.draw(this.resolution.share < 1);
    playback.companion?.show();
    this.onTick(position);
    if (waited !== playback.buffering) this.onState();
    this.lastTick = this.isMoving ? now : 0;
    if (this.isMoving || wasMoving) this.wake();
  }

  /** Shows a place of this capture as the lead shows its own: at once, from the same side and as fine. */
  follow(lead: Player, transport: Transport) {
    this.playback.follow(transport);
    this.resolution.share = lead.resolution.share;
    if (!this.motion.isEmpty) this.stage.moveGround(this.centre());
    this.draw(lead.resolution.share < 1);
  }

  private draw(hurried = false) {
    if (this.surface.showPartsOf(this.transport.position)) this.onState();
    this.stage.draw(this.camera, hurried);
  }

  private get followReach(): number {
    return FOLLOW_SECONDS * this.transport.rate;
  }

  /** The middle of the model at the place that is shown, in the scene. */
  private centre(): number[] {
    return [...this.stage.inScene(this.motion.centreAt(this.transport.position, this.followReach))];
  }

  private include(block: FrameBlock) {
    this.motion.include(block);
    if (this.isSurveyed) return;
    this.isSurveyed = true;
    const { playback } = this;
    const read = (frame: number) => playback.read(frame);
    const state = () => (playback.buffering ? 'buffering' : this.isPrepared ? 'ready' : 'preparing');
    void surveyMotion(this.capture, this.motion, read, state, this.stop.signal);
  }

  /** Frames the motion as it is known by now in the picture as it is now, unless somebody has moved the camera. */
  refit(atOnce = !this.isPrepared || this.fitsRest) {
    if (this.controls.destination !== this.fitted) return;
    if (this.fitsFromHome) this.goHome(atOnce);
    else this.frameAll(undefined, atOnce);
  }

  private regainContext() {
    this.onProblem(null);
    this.heatMap.refresh();
    this.refresh();
  }

  private loseContext(event: Event) {
    event.preventDefault();
    this.onProblem('GPU context lost; recovering.');
  }
}
