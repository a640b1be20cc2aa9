import type { Capture } from '../capture';
import { canCompute } from '../coordinates/compute';
import { computePhi } from '../coordinates/pool';
import { framed, HOME, zoomed, type CameraState } from '../render/camera';
import { CameraControls } from '../render/cameraControls';
import { FrameStore, type FrameEdit } from '../render/frameStore';
import type { Original } from '../originals/original';
import { Stage, type Covered, type Layers } from '../render/stage';
import { Comparison } from './comparison';
import { HeatMap, type Heat } from './heatMap';
import { Holes } from './holes';
import { Quality } from './quality';
import { advanced, framesAhead, framesAround, sought, standing, USUAL_RATE, type Transport } from './transport';
import { USUAL_LAYERS } from './viewState';

/** What is being done before the model can be seen; the fraction is null where nobody knows it. */
export interface Progress {
  readonly doing: string;
  readonly fraction: number | null;
}

/** Frames that are loaded ahead of the one that is shown. */
const AHEAD = 24;
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
  /** The original frames, where they are at hand. */
  readonly comparison: Comparison;
  progress: Progress | null = null;
  /** Whether the frame that should be shown has not come yet. */
  buffering = false;
  /** Whether pictures stay as fine as they can be though something moves. */
  keepsQuality = false;
  /** Frames that were passed over because pictures came too slowly. */
  dropped = 0;
  private readonly store: FrameStore;
  private readonly stop = new AbortController();
  private state: Transport;
  private shownLayers = USUAL_LAYERS;
  private shownPosition = -1;
  /** Frames that could not be loaded: they are not asked for again until somebody plays or seeks. */
  private readonly holes = new Holes();
  private captureProblem: string | null = null;
  private poseIsOld = true;
  private scheduled = 0;
  private lastTick = 0;
  private covered: Covered = { right: 0, bottom: 0 };
  private size = { width: 1, height: 1, pixelRatio: 1 };
  private shownShare = 1;
  private isMoving = false;
  /** Whether Φ is there, or will never be. */
  private isPrepared = false;
  private readonly quality = new Quality();

  /** Throws one sentence for a person where the browser cannot draw the capture. */
  constructor(
    canvas: HTMLCanvasElement,
    readonly capture: Capture,
  ) {
    this.stage = new Stage(canvas, capture.static);
    this.controls = new CameraControls(canvas);
    this.controls.onMove = () => this.wake();
    this.store = new FrameStore(capture);
    this.store.onArrival = () => this.wake();
    this.store.onFailure = (frame, error) => this.failFrame(frame, error);
    this.store.onReplaced = () => this.replaceFrames();
    this.store.onBlock = ({ cages }) => this.stage.include(cages, capture.static.rowsPerFrame);
    this.heatMap = new HeatMap(capture, this.stage, this.store);
    this.heatMap.onChange = () => {
      this.onState();
      this.wake();
    };
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
    this.holes.clear();
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

  setUp(axis: 'y' | 'z') {
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

  /** Shows all of the capture as it is now, from the side the camera is on or from the usual one. */
  frameAll(from: CameraState = this.controls.destination, atOnce = false) {
    const { clientWidth, clientHeight } = this.stage.canvas;
    const free = Math.max(1, clientHeight - this.covered.bottom);
    const fitting = framed(from, this.stage.bounds(), Math.max(1, clientWidth - this.covered.right) / free);
    this.controls.go(zoomed(fitting, clientHeight / free), atOnce);
  }

  /** Shows all of the capture from the usual side. */
  goHome(atOnce = false) {
    this.frameAll(HOME, atOnce);
  }

  /** Takes the size of the canvas in CSS pixels, and how much of it is covered. */
  resize(width: number, height: number, pixelRatio: number, covered: Covered) {
    this.covered = covered;
    this.size = { width, height, pixelRatio: this.stage.isJagged ? 2 * pixelRatio : pixelRatio };
    this.shownShare = 0;
    this.setShare(this.isMoving ? this.quality.moving : 1);
    // At once: the canvas is empty after a change of its size.
    this.stage.draw(this.controls.camera);
    this.wake();
  }

  /** Draws anew, whatever has changed. */
  refresh() {
    this.poseIsOld = true;
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
    this.setShare(1);
    this.stage.draw(this.controls.camera);
    return new Promise((resolve, reject) => {
      this.stage.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('The picture could not be made.'))));
    });
  }

  dispose() {
    this.stop.abort();
    cancelAnimationFrame(this.scheduled);
    this.controls.dispose();
    this.store.close();
    this.stage.dispose();
  }

  private async prepare() {
    const { signal } = this.stop;
    const onProgress = (fraction: number) => this.report({ doing: this.progress?.doing ?? '', fraction });
    try {
      const fetching = !canCompute(this.capture.static.system) && this.capture.coordinates !== undefined;
      this.report({ doing: fetching ? 'Fetching coordinates' : 'Computing coordinates', fraction: 0 });
      const phi = fetching
        ? await this.capture.coordinates!(onProgress, signal)
        : await computePhi(this.capture.static, { signal, onProgress });
      await this.stage.decoder.setPhi(phi);
      signal.throwIfAborted();
      this.stage.setLayers(this.shownLayers);
    } catch (error) {
      if (signal.aborted) return;
      // The cage can still be looked at.
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
    const { frames, complete, problem } = this.capture;
    this.state = sought({ ...this.state, frames, complete }, this.state.position);
    if (problem !== this.captureProblem) this.onProblem(problem);
    this.captureProblem = problem;
    this.onState();
    this.wake();
  }

  private wake() {
    if (this.stop.signal.aborted || this.scheduled !== 0) return;
    this.scheduled = requestAnimationFrame((now) => this.tick(now));
  }

  private tick(now: number) {
    this.scheduled = 0;
    const sinceLast = this.lastTick === 0 ? 0 : (now - this.lastTick) / 1000;
    const seconds = Math.min(LONGEST_STEP, sinceLast);
    const moved = this.controls.advance(seconds);
    const waited = this.buffering;
    this.play(seconds);
    const wasMoving = this.isMoving;
    this.isMoving = moved || (this.state.playing && this.state.frames > 1 && this.isPrepared);
    if (this.isMoving && wasMoving) this.quality.measure(sinceLast);
    // Pictures become fine again one picture after everything has come to rest.
    this.setShare(this.isMoving || wasMoving ? this.quality.moving : 1);
    this.stage.draw(this.controls.camera, this.shownShare < 1);
    this.onTick(this.state.position);
    if (waited !== this.buffering) this.onState();
    this.lastTick = this.isMoving ? now : 0;
    if (this.isMoving || wasMoving) this.wake();
  }

  private setShare(share: number) {
    const wanted = this.keepsQuality ? 1 : share;
    if (wanted === this.shownShare) return;
    this.shownShare = wanted;
    const { width, height, pixelRatio } = this.size;
    this.stage.resize(width, height, pixelRatio * wanted, this.covered);
  }

  /** Moves on if the frames are there, and sees to those that will be needed. */
  private play(seconds: number) {
    // While Φ is computed, pictures would take the processor from it.
    const advancing = this.isPrepared ? advanced(this.state, seconds) : this.state;
    const news = this.holes.news(Math.floor(advancing.position));
    if (news !== null) this.onProblem(news);
    const next = advancing.playing ? this.holes.past(advancing) : advancing;
    const original = this.wantedOriginal;
    // Between two frames there is nothing to compare.
    const { before, after, mix } = this.soundFramesAround(original ? { ...next, smooth: false } : next);
    const [here, there] = [this.store.peek(before), mix > 0 ? this.store.peek(after) : null];
    this.store.prefetch([...framesAhead(next, AHEAD)].filter((frame) => !this.holes.at(frame)));
    if (!here || (mix > 0 && !there)) {
      const missing = here ? after : before;
      this.buffering = next.frames > 0 && !this.holes.at(missing);
      if (this.buffering) this.store.load(missing).catch((error: unknown) => this.failFrame(missing, error));
      else this.stopAt(next);
      return;
    }
    original?.prefetch(framesAhead(next, ORIGINALS_AHEAD));
    if (original && !original.peek(before)) {
      this.buffering = true;
      original.load(before).then(
        () => this.wake(),
        (error: unknown) => this.failOriginal(error),
      );
      return;
    }
    this.buffering = false;
    if (this.state.playing && next === advancing)
      this.dropped += Math.max(0, Math.floor(next.position) - Math.floor(this.state.position) - 1);
    const ended = this.state.playing && !next.playing;
    this.state = next;
    if (ended) this.onState();
    if (!this.poseIsOld && before + mix === this.shownPosition) return;
    this.poseIsOld = false;
    this.shownPosition = before + mix;
    const rows = there ? blendedRows(here.rows, there.rows, mix) : here.rows;
    this.heatMap.update(before, this.state.frames);
    this.stage.setPose({ rows, before: here.offsets, after: there?.offsets ?? null, mix });
    this.comparison.update(before);
    this.heatMap.measure(before, original);
  }

  private failFrame(frame: number, error: unknown) {
    if (this.stop.signal.aborted) return;
    const { first, count } = this.capture.readTogether?.(frame) ?? { first: frame, count: 1 };
    this.holes.add({ first, count, problem: sentence(error) });
    this.wake();
  }

  /** Stops where playing cannot go on. */
  private stopAt(next: Transport) {
    if (!this.state.playing || next.playing) return;
    this.state = next;
    this.onState();
  }

  /** Frames to blend; the one before a hole stands until it is over. */
  private soundFramesAround(transport: Transport): ReturnType<typeof framesAround> {
    const frames = framesAround(transport);
    return frames.mix > 0 && this.holes.at(frames.after) ? { ...frames, after: frames.before, mix: 0 } : frames;
  }

  private replaceFrames() {
    this.holes.clear();
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

function blendedRows(from: Float32Array, to: Float32Array, share: number): Float64Array {
  const rows = new Float64Array(from.length);
  for (let k = 0; k < rows.length; k++) rows[k] = from[k] + (to[k] - from[k]) * share;
  return rows;
}

function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
