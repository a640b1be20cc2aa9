import type { Capture } from '../capture';
import { framed, HOME, zoomed, type CameraState } from '../render/camera';
import { CameraControls } from '../render/cameraControls';
import type { Covered, Layers } from '../render/drawn';
import type { FrameEdit } from '../render/frameStore';
import { Stage } from '../render/stage';
import { followBandwidth } from './bandwidth';
import type { Comparison } from './comparison';
import type { Heat, HeatMap } from './heatMap';
import { isFetched, phiOf } from './phi';
import { Playback, type Deformation } from './playback';
import { Quality } from './quality';
import { Resolution } from './resolution';
import { sentence } from './text';
import { advanced, type Transport } from './transport';
import { USUAL_LAYERS } from './viewState';

/** What is being done before the model can be seen; the fraction is null where nobody knows it. */
export interface Progress {
  readonly doing: string;
  readonly fraction: number | null;
}

/** Longest step of the clock: a tab that was hidden goes on where it was. */
const LONGEST_STEP = 0.1;

/** Plays one capture on a canvas: clock, frames, decoding and camera. The element around it shows the controls. */
export class Player {
  /** Called after every picture, with the place in the capture. */
  onTick: (position: number) => void = () => undefined;
  /** Called when anything but the place has changed. */
  onState: () => void = () => undefined;
  /** Called when something went wrong, with one sentence; with null when it is over. */
  onProblem: (problem: string | null) => void = () => undefined;
  readonly stage: Stage;
  readonly controls: CameraControls;
  readonly resolution: Resolution;
  progress: Progress | null = null;
  /** The place that is shown. */
  readonly playback: Playback;
  readonly heatMap: HeatMap;
  /** The original frames, where they are at hand. */
  readonly comparison: Comparison;
  private readonly stop = new AbortController();
  private shownLayers = USUAL_LAYERS;
  private scheduled = 0;
  private lastTick = 0;
  private isMoving = false;
  /** Whether Φ is there, or will never be. */
  private isPrepared = false;
  private readonly quality: Quality;
  private upAxis: 'y' | 'z' = 'y';

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
    this.playback = new Playback(capture, this.stage, {
      wake: () => this.wake(),
      refresh: () => this.refresh(),
      changed: () => this.onState(),
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

  /** Pictures per second while something moves. */
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

  get up(): 'y' | 'z' {
    return this.upAxis;
  }

  setUp(axis: 'y' | 'z') {
    this.upAxis = axis;
    this.stage.setUp(axis);
    this.refresh();
  }

  setHeat(heat: Heat) {
    this.heatMap.show(heat);
    this.refresh();
  }

  /** Shows frames with other rows than the capture has: `edit` gives those of a frame. Null shows the capture itself. */
  setFrameEdit(edit: FrameEdit | null) {
    this.playback.setFrameEdit(edit);
    // Movement is that of the frames as they are shown.
    this.setHeat(this.heatMap.kind);
  }

  /** Draws frames deformed; null draws them as they are. */
  deform(deformation: Deformation | null) {
    if (deformation === this.playback.deformation) return;
    this.playback.deformation = deformation;
    this.refresh();
  }

  /** Shows all of the capture as it is now, from the side the camera is on or from the usual one. */
  frameAll(from: CameraState = this.controls.destination, atOnce = false) {
    const { clientWidth, clientHeight } = this.stage.canvas;
    const { right, bottom } = this.resolution.covered;
    const free = Math.max(1, clientHeight - bottom);
    const fitting = framed(from, this.stage.bounds(), Math.max(1, clientWidth - right) / free);
    this.controls.go(zoomed(fitting, clientHeight / free), atOnce);
  }

  /** Shows all of the capture from the usual side. */
  goHome(atOnce = false) {
    this.frameAll(HOME, atOnce);
  }

  /** Takes the size of the canvas in CSS pixels, and how much of it is covered. */
  resize(width: number, height: number, pixelRatio: number, covered: Covered) {
    this.resolution.resize(width, height, pixelRatio, covered, this.isMoving ? this.quality.moving : this.resting);
    if (this.stage.wasEmptied) this.stage.draw(this.controls.camera);
    this.wake();
  }

  /** Draws anew, whatever has changed. */
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

  /** The picture as it is now. */
  picture(): Promise<Blob> {
    this.resolution.share = 1;
    this.stage.renew();
    this.stage.draw(this.controls.camera);
    return new Promise((resolve, reject) => {
      this.stage.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('The picture could not be made.'))));
    });
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
    try {
      const doing = isFetched(this.capture) ? 'Fetching coordinates' : 'Computing coordinates';
      const onProgress = (fraction: number) => this.report({ doing, fraction });
      onProgress(0);
      await this.stage.decoder.setPhi(await phiOf(this.capture, onProgress, signal));
      signal.throwIfAborted();
      this.stage.setLayers(this.shownLayers);
    } catch (error) {
      if (signal.aborted) return;
      // The cage can still be looked at.
      this.stage.hideModel();
      this.layers = { ...this.shownLayers, cage: true };
      this.onProblem(sentence(error));
    }
    this.isPrepared = true;
    this.report(null);
    this.refresh();
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
    followBandwidth(this.capture, playback.transport);
    const sinceLast = this.lastTick === 0 ? 0 : (now - this.lastTick) / 1000;
    const seconds = Math.min(LONGEST_STEP, sinceLast);
    const turned = this.controls.advance(seconds);
    const waited = playback.buffering;
    const isDeforming = playback.deformation?.isMoving === true;
    playback.poseIsOld ||= isDeforming;
    // While Φ is computed, pictures would take the processor from it.
    playback.moveTo(this.isPrepared ? advanced(playback.transport, seconds) : playback.transport, now / 1000);
    const { playing, frames, position } = playback.transport;
    const wasMoving = this.isMoving;
    this.isMoving = turned || isDeforming || (playing && frames > 1 && this.isPrepared);
    if (this.isMoving && wasMoving) this.quality.measure(sinceLast);
    // Pictures become fine again one picture after everything has come to rest.
    this.resolution.share = this.isMoving || wasMoving ? this.quality.moving : this.resting;
    this.stage.draw(this.controls.camera, this.resolution.share < 1);
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
    this.stage.draw(lead.controls.camera, lead.resolution.share < 1);
  }

  private regainContext() {
    this.onProblem(null);
    this.heatMap.refresh();
    this.refresh();
  }

  private loseContext(event: Event) {
    event.preventDefault();
    this.onProblem(
      'The graphics processor was taken away from the page; the picture comes back as soon as it is free.',
    );
  }
}
