import type { Capture } from '../capture';
import { framed, HOME, zoomed, type CameraState } from '../render/camera';
import { CameraControls } from '../render/cameraControls';
import { FrameStore, type FrameEdit } from '../render/frameStore';
import type { Original } from '../originals/original';
import { Stage, type Covered, type Layers } from '../render/stage';
import { Comparison } from './comparison';
import { followBandwidth } from './bandwidth';
import { blendedRows, FrameFeed } from './frameFeed';
import { HeatMap, type Heat } from './heatMap';
import { isFetched, phiOf } from './phi';
import { Quality } from './quality';
import { Resolution } from './resolution';
import { sentence } from './text';
import { advanced, framesAhead, sought, standing, USUAL_RATE, type Transport } from './transport';
import { USUAL_LAYERS } from './viewState';

/** What is being done before the model can be seen; the fraction is null where nobody knows it. */
export interface Progress {
  readonly doing: string;
  readonly fraction: number | null;
}

/** Rows of a cage, `rowsPerFrame × 3`, that are drawn in place of those of a frame. */
export interface Deformation {
  /** Whether they change from picture to picture. */
  readonly isMoving: boolean;
  /** @param seconds of a clock that goes on while nothing plays */
  rows(rows: Float32Array | Float64Array, seconds: number): Float64Array;
}

/** What is shown together with a capture, in step with it. */
export interface Companion {
  /** Whether what belongs to a place is there, or will never be; sees to it that it comes. */
  prepare(transport: Transport): boolean;
  /** Shows what belongs to the place that the player shows. */
  show(): void;
}

/** Frames of the original that are read ahead. */
const ORIGINALS_AHEAD = 3;
/** Frames that a live capture is entered before its end, so that playing does not wait for every one. */
const LIVE_MARGIN = 15;
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
  readonly heatMap: HeatMap;
  readonly resolution: Resolution;
  /** The original frames, where they are at hand. */
  readonly comparison: Comparison;
  /** What is shown together with this capture. */
  companion: Companion | null = null;
  progress: Progress | null = null;
  /** Whether the frame that should be shown has not come yet. */
  buffering = false;
  /** Frames that were passed over because pictures came too slowly. */
  dropped = 0;
  private readonly store: FrameStore;
  private readonly stop = new AbortController();
  private state: Transport;
  private shownLayers = USUAL_LAYERS;
  private shownPosition = -1;
  private readonly feed: FrameFeed;
  private captureProblem: string | null = null;
  private poseIsOld = true;
  private scheduled = 0;
  private lastTick = 0;
  private isMoving = false;
  /** Whether Φ is there, or will never be. */
  private isPrepared = false;
  private readonly quality: Quality;
  private deformation: Deformation | null = null;
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
    this.store = new FrameStore(capture);
    this.store.onArrival = () => this.wake();
    this.feed = new FrameFeed(capture, this.store, () => this.wake());
    this.store.onReplaced = () => this.replaceFrames();
    this.store.onBlock = ({ cages }) => this.stage.include(cages, capture.static.rowsPerFrame);
    this.heatMap = new HeatMap(capture, this.stage, this.store);
    this.heatMap.onChange = () => {
      this.onState();
      this.wake();
    };
    this.heatMap.onRange = () => this.refresh();
    this.comparison = new Comparison(capture, this.stage);
    this.comparison.onChange = () => this.refresh();
    this.state = { ...standing(), rate: capture.static.frameRate ?? USUAL_RATE };
    this.followCapture();
    if (!capture.complete) this.state = sought(this.state, capture.frames - LIVE_MARGIN);
    capture.events.addEventListener('change', () => this.followCapture(), { signal: this.stop.signal });
    canvas.addEventListener('webglcontextlost', (event) => this.loseContext(event), { signal: this.stop.signal });
    canvas.addEventListener('webglcontextrestored', () => this.regainContext(), { signal: this.stop.signal });
    this.stage.setLayers(this.shownLayers);
    void this.prepare();
  }

  get transport(): Transport {
    return this.state;
  }

  set transport(transport: Transport) {
    this.state = transport;
    this.feed.holes.clear();
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
    this.store.edit = edit;
    // Movement is that of the frames as they are shown.
    this.setHeat(this.heatMap.kind);
  }

  /** Draws frames deformed; null draws them as they are. */
  deform(deformation: Deformation | null) {
    if (deformation === this.deformation) return;
    this.deformation = deformation;
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
    this.poseIsOld = true;
    this.stage.renew();
    this.onState();
    this.wake();
  }

  /** Positions of a frame as the graphics processor decodes them, x y z of each point in the capture's unit. */
  async readPositions(frame: number): Promise<Float32Array> {
    if (!this.stage.decoder.ready) throw new Error('The model is not ready yet; wait until it is shown.');
    const { rows, offsets } = await this.store.frame(frame);
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
    this.feed.close();
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

  private followCapture() {
    const { frames, complete, problem, frameNumbers: numbers } = this.capture;
    this.state = sought({ ...this.state, frames, complete, numbers }, this.state.position);
    if (problem !== this.captureProblem) this.onProblem(problem);
    this.captureProblem = problem;
    this.onState();
    this.wake();
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
    followBandwidth(this.capture, this.state);
    const sinceLast = this.lastTick === 0 ? 0 : (now - this.lastTick) / 1000;
    const seconds = Math.min(LONGEST_STEP, sinceLast);
    const moved = this.controls.advance(seconds);
    const waited = this.buffering;
    this.poseIsOld ||= this.deformation?.isMoving === true;
    this.play(seconds, now / 1000);
    const wasMoving = this.isMoving;
    this.isMoving =
      moved || this.deformation?.isMoving === true || (this.state.playing && this.state.frames > 1 && this.isPrepared);
    if (this.isMoving && wasMoving) this.quality.measure(sinceLast);
    // Pictures become fine again one picture after everything has come to rest.
    this.resolution.share = this.isMoving || wasMoving ? this.quality.moving : this.resting;
    this.stage.draw(this.controls.camera, this.resolution.share < 1);
    this.companion?.show();
    this.onTick(this.state.position);
    if (waited !== this.buffering) this.onState();
    this.lastTick = this.isMoving ? now : 0;
    if (this.isMoving || wasMoving) this.wake();
  }

  /** Whether the frames of a place are there, or will never be; asks for those that are missing. */
  prepareFor(transport: Transport): boolean {
    return this.feed.prepare(transport);
  }

  /** Shows a place of this capture as the lead shows its own: at once, from the same side and as fine. */
  follow(lead: Player, transport: Transport) {
    this.state = transport;
    this.play(0);
    this.resolution.share = lead.resolution.share;
    this.stage.draw(lead.controls.camera, lead.resolution.share < 1);
  }

  /** Moves on if the frames are there, and sees to those that will be needed. */
  private play(seconds: number, now = 0) {
    // While Φ is computed, pictures would take the processor from it.
    const advancing = this.isPrepared ? advanced(this.state, seconds) : this.state;
    const news = this.feed.holes.news(Math.floor(advancing.position));
    if (news !== null) this.onProblem(news);
    const next = advancing.playing ? this.feed.holes.past(advancing) : advancing;
    const original = this.wantedOriginal;
    // Between two frames there is nothing to compare.
    const found = this.feed.at(original ? { ...next, smooth: false } : next);
    this.feed.prefetch(next);
    if (typeof found === 'number') {
      this.buffering = next.frames > 0 && !this.feed.holes.at(found);
      if (this.buffering) this.feed.load(found);
      else this.stopAt(next);
      return;
    }
    const { before, mix, here, there } = found;
    original?.prefetch(framesAhead(next, ORIGINALS_AHEAD));
    if (original && !original.peek(before)) {
      this.buffering = true;
      original.load(before).then(
        () => this.wake(),
        (error: unknown) => this.failOriginal(error),
      );
      return;
    }
    this.buffering = this.companion?.prepare(next) === false;
    if (this.buffering) return;
    if (this.state.playing && next === advancing)
      this.dropped += Math.max(0, Math.floor(next.position) - Math.floor(this.state.position) - 1);
    const ended = this.state.playing && !next.playing;
    this.state = next;
    if (ended) this.onState();
    if (!this.poseIsOld && before + mix === this.shownPosition) return;
    this.poseIsOld = false;
    this.shownPosition = before + mix;
    this.heatMap.update(before, this.state.frames);
    const rows = this.deformation?.rows(blendedRows(found), now) ?? blendedRows(found);
    this.stage.setPose({ rows, before: here.offsets, after: there?.offsets ?? null, mix });
    this.comparison.update(before);
    this.heatMap.measure(before, original);
  }

  /** Stops where playing cannot go on. */
  private stopAt(next: Transport) {
    if (!this.state.playing || next.playing) return;
    this.state = next;
    this.onState();
  }

  private replaceFrames() {
    this.feed.holes.clear();
    this.heatMap.refresh();
    this.refresh();
  }

  /** The original, where what is shown needs it. */
  private get wantedOriginal(): Original | null {
    const { original, side } = this.comparison;
    return side !== 'decoded' || this.heatMap.kind === 'error' ? original : null;
  }

  private failOriginal(error: unknown) {
    if (this.stop.signal.aborted || !this.comparison.original) return;
    this.buffering = false;
    this.comparison.close();
    this.setHeat('none');
    this.onProblem(sentence(error));
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
