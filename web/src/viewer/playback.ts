import type { Capture, FrameBlock } from '../capture';
import type { Original } from '../originals/original';
import { FrameStore, type FrameEdit } from '../render/frameStore';
import type { Motion } from '../render/motion';
import type { Stage } from '../render/stage';
import { Comparison } from './comparison';
import { blendedRows, FrameFeed, type Blend } from './frameFeed';
import { HeatMap } from './heatMap';
import { sentence } from '../text';
import { framesAhead, liveFrame, sought, standing, USUAL_RATE, type Transport } from './transport';

/** What is shown together with a capture, in step with it. */
export interface Companion {
  /** Whether what belongs to a place is there, or will never be; sees to it that it comes. */
  prepare(transport: Transport): boolean;
  /** Shows what belongs to the place that is shown of the capture. */
  show(): void;
}

export interface PlaybackListener {
  arrived(block: FrameBlock): void;
  /** Another picture is due. */
  wake(): void;
  /** What is drawn has changed where the place has not. */
  refresh(): void;
  /** Anything but the place has changed. */
  changed(): void;
  /** Something went wrong, in one sentence; null when it is over. */
  problem(problem: string | null): void;
  /** What this sentence said is over. */
  recovered(problem: string): void;
}

const ORIGINALS_AHEAD = 3;

/** The place of a capture that is shown: moves on when its frames are there, fetches them, and poses the stage. */
export class Playback {
  readonly heatMap: HeatMap;
  readonly comparison: Comparison;
  companion: Companion | null = null;
  /** Rows of a cage, `rowsPerFrame × 3`, that are drawn in place of those of frames; residuals are left out then. */
  shape: Float64Array | null = null;
  /** Whether the frame that should be shown has not come yet. */
  buffering = false;
  /** Frames that were passed over because pictures came too slowly. */
  dropped = 0;
  /** Whether the frame that is shown is to be posed anew. */
  poseIsOld = true;
  private readonly store: FrameStore;
  private readonly feed: FrameFeed;
  private state: Transport;
  private shownPosition = -1;
  /** The frame whose distances from the surface it was recovered from are being measured. */
  private observing: number | null = null;
  private captureProblem: string | null = null;
  private isClosed = false;

  constructor(
    private readonly capture: Capture,
    private readonly stage: Stage,
    motion: Motion,
    private readonly listener: PlaybackListener,
  ) {
    this.store = new FrameStore(capture);
    this.store.onArrival = () => listener.wake();
    this.store.onReplaced = () => this.replaceFrames();
    this.feed = new FrameFeed(capture, this.store, {
      changed: () => listener.wake(),
      troubled: (problem) => listener.problem(problem),
      recovered: (problem) => listener.recovered(problem),
    });
    this.store.onBlock = (block) => {
      this.feed.arrived(block);
      listener.arrived(block);
    };
    this.heatMap = new HeatMap(stage, this.store, motion);
    this.heatMap.onChange = () => {
      listener.changed();
      listener.wake();
    };
    this.heatMap.onRange = () => listener.refresh();
    this.comparison = new Comparison(capture, stage);
    this.comparison.onChange = () => listener.refresh();
    this.state = { ...standing(), rate: capture.static.frameRate ?? USUAL_RATE };
    this.followCapture();
    if (!capture.complete) this.state = { ...sought(this.state, liveFrame(this.state)), live: true };
  }

  get transport(): Transport {
    return this.state;
  }

  /** Goes to a place, and asks anew for frames that did not come before. Whoever pauses a live picture leaves the newest frames. */
  go(transport: Transport) {
    this.state = { ...transport, live: transport.live && (transport.playing || !this.state.playing) };
    this.feed.holes.clear();
  }

  setFrameEdit(edit: FrameEdit | null) {
    this.store.edit = edit;
  }

  frame(frame: number): ReturnType<FrameStore['frame']> {
    return this.store.frame(frame);
  }

  /** Takes note of frames that the capture has got, and of what happened to it. */
  followCapture() {
    const { frames, complete, problem, frameNumbers: numbers } = this.capture;
    const { position, live } = this.state;
    this.state = { ...sought({ ...this.state, frames, complete, numbers }, position), live: live && !complete };
    if (problem !== this.captureProblem) this.listener.problem(problem);
    this.captureProblem = problem;
    this.listener.changed();
    this.listener.wake();
  }

  /** Whether the frames of a place are there, or will never be; asks for those that are missing. */
  prepare(transport: Transport): boolean {
    return this.feed.prepare(transport);
  }

  /** Has the block of a frame read and kept, without playing it. */
  read(frame: number): Promise<unknown> {
    return this.store.read(frame);
  }

  /** Goes to a place that somebody else has moved on to, whether or not its frames are there. */
  follow(transport: Transport) {
    this.state = transport;
    this.moveTo(transport);
  }

  /** Moves on to a place if its frames are there, and sees to those that will be needed. */
  moveTo(advancing: Transport) {
    const news = this.feed.holes.news(Math.floor(advancing.position));
    if (news !== null) this.listener.problem(news);
    const next = advancing.playing ? this.feed.holes.past(advancing) : advancing;
    const original = this.wantedOriginal;
    // Between two frames there is nothing to compare.
    const found = this.feed.at(original || this.isObserving ? { ...next, smooth: false } : next);
    this.feed.prefetch(next);
    if (typeof found === 'number') {
      this.buffering = next.frames > 0 && !this.feed.holes.at(found);
      if (this.buffering) this.feed.load(found);
      else this.stopAt(next);
      return;
    }
    // Each frame is shown with its surface.
    if (this.observing !== null && this.observing !== found.before) return;
    original?.prefetch(framesAhead(next, ORIGINALS_AHEAD));
    const lacksOriginal = original !== null && !original.peek(found.before);
    if (lacksOriginal) this.loadOriginal(original, found.before);
    this.buffering = lacksOriginal || this.companion?.prepare(next) === false;
    if (this.buffering) return;
    if (this.state.playing && next === advancing)
      this.dropped += Math.max(0, Math.floor(next.position) - Math.floor(this.state.position) - 1);
    const ended = this.state.playing && !next.playing;
    this.state = next;
    if (ended) this.listener.changed();
    this.pose(found, original);
  }

  close() {
    this.isClosed = true;
    this.feed.close();
    this.comparison.surfaces?.close();
  }

  private pose(found: Blend, original: Original | null) {
    const { before, mix, here, there } = found;
    if (!this.poseIsOld && before + mix === this.shownPosition) return;
    this.poseIsOld = false;
    this.shownPosition = before + mix;
    this.heatMap.update(before, this.state.frames);
    const { shape } = this;
    this.stage.setPose({
      rows: shape ?? blendedRows(found),
      before: shape ? null : here.offsets,
      after: shape ? null : (there?.offsets ?? null),
      mix,
    });
    this.comparison.update(before);
    this.heatMap.measure(before, this.state.frames, original);
    if (this.isObserving && this.observing !== before) void this.observe(before);
  }

  /** Shows the surface that the frame which is shown was recovered from, and how far it is. */
  private async observe(frame: number) {
    const { surfaces } = this.comparison;
    if (!surfaces || !this.stage.decoder.ready) return;
    this.observing = frame;
    try {
      const observed = await this.heatMap.observe(frame, surfaces);
      if (this.comparison.surfaces === surfaces) this.stage.setObserved(observed.surface);
    } catch (error) {
      if (this.comparison.surfaces === surfaces) this.failOriginal(error);
    }
    this.observing = null;
    this.listener.wake();
  }

  private stopAt(next: Transport) {
    if (!this.state.playing || next.playing) return;
    this.state = next;
    this.listener.changed();
  }

  private replaceFrames() {
    this.feed.holes.clear();
    this.heatMap.refresh();
    this.listener.refresh();
  }

  private get isObserving(): boolean {
    const { surfaces, side } = this.comparison;
    return surfaces !== null && (side !== 'decoded' || this.heatMap.kind === 'error');
  }

  /** The original, where what is shown needs it. */
  private get wantedOriginal(): Original | null {
    const { original, side } = this.comparison;
    return side !== 'decoded' || this.heatMap.kind === 'error' ? original : null;
  }

  private loadOriginal(original: Original, frame: number) {
    original.load(frame).then(
      () => this.listener.wake(),
      (error: unknown) => this.failOriginal(error),
    );
  }

  private failOriginal(error: unknown) {
    if (this.isClosed || !this.comparison.isOpen) return;
    this.buffering = false;
    this.comparison.close();
    this.heatMap.show('none', this.heatMap.range);
    this.listener.refresh();
    this.listener.problem(sentence(error));
  }
}
