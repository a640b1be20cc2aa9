import { LitElement, type PropertyValues } from 'lit';
import { property, query, state } from 'lit/decorators.js';
import type { Capture, UpAxis } from '../capture';
import { Opener } from './opener';
import { Player } from './player';
import { sentence } from '../text';
import { sought, started } from './transport';
import { ViewLink } from './viewLink';
import { viewFromText } from './viewState';

/** An element that plays a capture on a canvas: it opens what its properties name, and begins and ends the player. */
export abstract class CaptureElement extends LitElement {
  @property() src: string | null = null;
  @property() name: string | null = null;
  @property({ type: Boolean }) autoplay = false;
  /** The capture to play; whoever sets it closes it. */
  @property({ attribute: false }) capture: Capture | null = null;
  /** The view to go to, as `viewchange` tells it. */
  @property() view = '';
  @state() player: Player | null = null;
  @state() protected problem: string | null = null;
  @query('canvas') protected readonly canvas!: HTMLCanvasElement;
  protected readonly opener = new Opener(this);
  protected readonly link = new ViewLink(() => this.tellView());
  private wasReady = false;
  private shownFrame = -1;

  open(file: File): Promise<void> {
    return this.opener.openFile(file);
  }

  goTo(text: string) {
    if (this.player) this.link.goTo(text, this.player);
    this.view = this.player ? '' : text;
  }

  play() {
    if (this.player) this.player.transport = started(this.player.transport);
  }

  pause() {
    if (this.player) this.player.transport = { ...this.player.transport, playing: false };
  }

  /** The frame that is shown; setting it goes there. */
  get frame(): number {
    return Math.floor(this.player?.transport.position ?? 0);
  }

  set frame(frame: number) {
    if (this.player) this.player.transport = sought(this.player.transport, frame);
  }

  /** Which axis of the capture points up. */
  get up(): UpAxis {
    return this.player?.up ?? 'y';
  }

  set up(axis: UpAxis) {
    this.player?.setUp(axis);
    if (this.player?.isHome) this.player.goHome();
    else this.player?.frameAll();
  }

  /** Positions of a frame as they are decoded for the picture, x y z of each point. */
  readPositions(frame: number): Promise<Float32Array> {
    if (!this.player) return Promise.reject(new Error('No capture is open.'));
    return this.player.readPositions(frame);
  }

  /** Shows one sentence about something that went wrong, or takes it away. */
  report(problem: string | null) {
    this.problem = problem;
    if (problem !== null) this.tell('problem', problem);
  }

  /** Takes a sentence away that still stands there. */
  recover(problem: string) {
    if (this.problem === problem) this.report(null);
  }

  /** What is written above the picture, and in file names. */
  get heading(): string {
    return this.name ?? this.player?.capture.name ?? this.opener.name ?? 'Capture';
  }

  get isShowing(): boolean {
    return this.player !== null;
  }

  get isOpening(): boolean {
    return this.opener.name !== null;
  }

  show(capture: Capture) {
    this.unload();
    this.opener.forget();
    this.problem = null;
    // A canvas whose context was given up cannot be used again.
    const canvas = this.canvas.cloneNode() as HTMLCanvasElement;
    this.canvas.replaceWith(canvas);
    canvas.addEventListener('dblclick', () => this.player?.frameAll());
    try {
      canvas.hidden = false;
      this.begin(new Player(canvas, capture));
    } catch (error) {
      this.fail(error);
    }
  }

  fail(error: unknown) {
    this.unload();
    this.opener.name = null;
    this.opener.failure = sentence(error);
    this.report(this.opener.failure);
  }

  override connectedCallback() {
    super.connectedCallback();
    // An element that was only moved still has its capture.
    if (this.hasUpdated && !this.isShowing && !this.isOpening) this.reopen();
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.link.stop();
    queueMicrotask(() => {
      if (this.isConnected) return;
      this.opener.stop();
      if (this.player) this.view = this.link.textOf(this.player);
      this.unload();
    });
  }

  protected override updated(changed: PropertyValues) {
    if (this.isConnected) this.follow(changed);
  }

  /** Called with every player before anything is drawn; to give it a size and colours. */
  protected abstract began(player: Player): void;

  protected tell(type: string, detail: unknown = null) {
    this.dispatchEvent(new CustomEvent(type, { detail, bubbles: true, composed: true }));
  }

  private follow(changed: PropertyValues) {
    if (changed.has('src') && this.src !== null) this.openAddress(this.src);
    else if (changed.get('src')) this.empty();
    if (changed.has('capture') && this.capture) this.show(this.capture);
    else if (changed.get('capture') && this.player?.capture === changed.get('capture')) this.empty();
    if (changed.has('view') && this.view !== '' && this.player) this.goTo(this.view);
  }

  private reopen() {
    if (this.opener.reopen()) return;
    if (this.capture) this.show(this.capture);
    else if (this.src !== null) this.openAddress(this.src);
  }

  private openAddress(src: string) {
    this.unload();
    void this.opener.openAddress(src);
  }

  private begin(player: Player) {
    const view = viewFromText(this.view);
    this.player = player;
    this.wasReady = false;
    player.onProblem = (problem) => this.report(problem);
    player.onRecovery = (problem) => this.recover(problem);
    player.onState = () => {
      this.requestUpdate();
      this.announceReady(player);
    };
    player.onTick = () => this.tick();
    player.controls.onGrab = () => this.canvas.focus();
    this.began(player);
    this.link.show(view, player, true);
    // It is the view of this capture, not of the next one.
    this.view = '';
    if (this.autoplay && view.frame === null && !matchMedia('(prefers-reduced-motion: reduce)').matches) this.play();
    if (player.capture.problem !== null) this.report(player.capture.problem);
  }

  /** Shows nothing, as if there never had been a capture. */
  private empty() {
    this.opener.stop();
    this.unload();
    this.opener.forget();
    this.problem = null;
  }

  protected unload() {
    this.player?.dispose();
    this.player = null;
    this.opener.close();
  }

  /** Called after every picture. */
  protected tick() {
    if (this.frame !== this.shownFrame) {
      this.shownFrame = this.frame;
      this.tell('framechange', this.frame);
    }
    this.link.touch();
  }

  /** Tells the view; called when it has rested for a while. */
  tellView() {
    if (this.player) this.tell('viewchange', this.link.textOf(this.player));
  }

  private announceReady(player: Player) {
    if (this.wasReady || !player.stage.decoder.ready) return;
    this.wasReady = true;
    this.tell('ready');
  }
}
