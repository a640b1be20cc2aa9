import { html, LitElement, nothing, type PropertyValues } from 'lit';
import { customElement, property, query, state } from 'lit/decorators.js';
import type { Capture } from '../capture';
import { openContainer } from '../container/open';
import { checkPrelude, PRELUDE_BYTES } from '../container/section';
import { blobSource, httpSource } from '../container/source';
import { controls, tokens } from '../style/tokens';
import { EditMode } from '../editing/editMode';
import { perform, stem } from './actions';
import { emptyState, notice, progressBox } from './messages';
import { liveBadge, liveFrame, livePlace } from './liveBadge';
import { panelStyle } from './panelStyle';
import { figuresPanel, helpSheet, legend, toolbar, transportBar } from './parts';
import { Player } from './player';
import { canRecord } from './recording';
import { actionOf, type Action } from './shortcuts';
import { stageColors } from './stageColors';
import { clock, fileNameOf, grouped, percent } from './text';
import './timeline';
import type { Timeline } from './timeline';
import { sought, started } from './transport';
import type { Dropped } from '../upload/classify';
import { droppedFiles } from '../upload/drop';
import { divider } from './comparisonParts';
import { comparisonStyle } from './comparisonStyle';
import { PointMarks } from './pointMarks';
import { viewerStyle } from './viewerStyle';
import { viewFromText, viewText, type ViewState } from './viewState';

/** How long the view must rest before it is told to whoever keeps links. */
const REST_MILLISECONDS = 300;
/** CSS pixels below which the tools cover what matters. */
const NARROW = 680;
/** A finer picture than this costs more than it shows. */
const FINEST_PIXEL_RATIO = 2;

/**
 * Plays a capture: `<cager-viewer src="walk.cager" autoplay></cager-viewer>`, or one that is set as the property `capture`. A `.cager` file that is
 * dropped on it plays too; original frames that are dropped on it show where the error is.
 *
 * @attr src address of a container
 * @attr autoplay begins to play at once
 * @attr name what is written above the picture, in place of the file's name
 * @slot lead something before the title, such as a way back
 * @fires ready when the model can be seen
 * @fires framechange with the number of the frame that is shown
 * @fires viewchange with the view as text, when it rests, for links; set `view` to return to it
 * @fires problem with one sentence, when something failed
 * @fires filechosen with a container that somebody dropped or chose; whoever cancels it sees to the file
 * @fires signin when somebody wants to sign in, to follow a session on
 */
@customElement('cager-viewer')
export class CagerViewer extends LitElement {
  static override styles = [tokens, controls, viewerStyle, panelStyle, comparisonStyle];

  @property() src: string | null = null;
  @property() name: string | null = null;
  @property({ type: Boolean }) autoplay = false;
  /** The capture to play; whoever sets it closes it. */
  @property({ attribute: false }) capture: Capture | null = null;
  /** The view to go to, as `viewchange` tells it. */
  @property() view = '';
  @state() player: Player | null = null;
  @state() figures = false;
  @state() recording: AbortController | null = null;
  @state() private opening: string | null = null;
  @state() private problem: string | null = null;
  /** Why nothing can be shown. */
  @state() private failure: string | null = null;
  @state() private dropping = false;
  @query('canvas') private readonly canvas!: HTMLCanvasElement;
  @query('cager-timeline') private readonly timeline!: Timeline | null;
  @query('dialog') private readonly sheet!: HTMLDialogElement;
  readonly editing = new EditMode(this);
  private marks: PointMarks | null = null;
  private opened: Capture | null = null;
  private load = new AbortController();
  private removed = new AbortController();
  private look = 0;
  private shownFrame = -1;
  private deckHeight = 0;
  private panelShare = 0;
  private restTimer = 0;
  /** Kind of the live place that the badge was rendered for last. */
  private shownPlace = '';
  private secondTimer = 0;
  /** The file that is shown, where it is no address. */
  private file: File | null = null;
  private wasReady = false;
  private cameraWasMoved = false;
  private upAxis: 'y' | 'z' = 'y';
  private readonly sizes = new ResizeObserver(() => this.resize());

  /** Plays a file without any server. */
  async open(file: File): Promise<void> {
    await this.openFrom(file.name, (signal) => openContainer(blobSource(file), { name: file.name, signal }), file);
  }

  /** Goes to a view as `viewchange` tells it. */
  goTo(text: string) {
    const { player } = this;
    if (!player) {
      this.view = text;
      return;
    }
    const view = viewFromText(text);
    this.take(view, player, false);
    // A link without a frame is of the first one, or of a capture that plays.
    if (view.frame === null && !player.transport.playing) player.transport = sought(player.transport, 0);
    this.view = '';
  }

  /** Takes the frames that the capture was encoded from, and shows how far it is from them. */
  async openOriginal(files: readonly Dropped[] | Promise<readonly Dropped[]>): Promise<void> {
    const { player } = this;
    if (!player) return;
    try {
      await player.comparison.open(await files);
      if (player.heatMap.kind !== 'error') player.setHeat('error');
      this.problem = null;
    } catch (error) {
      this.report(error instanceof Error ? error.message : String(error));
    }
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
  get up(): 'y' | 'z' {
    return this.upAxis;
  }

  set up(axis: 'y' | 'z') {
    this.upAxis = axis;
    this.player?.setUp(axis);
    this.player?.frameAll();
  }

  /** Positions of a frame as they are decoded for the picture, x y z of each point. */
  readPositions(frame: number): Promise<Float32Array> {
    if (!this.player) return Promise.reject(new Error('There is no capture to read from; open one first.'));
    return this.player.readPositions(frame);
  }

  /** Shows one sentence about something that went wrong, or takes it away. */
  report(problem: string | null) {
    this.problem = problem;
    if (problem === null) return;
    this.dispatchEvent(new CustomEvent<string>('problem', { detail: problem, bubbles: true, composed: true }));
  }

  /** Shows the keyboard shortcuts. */
  openHelp() {
    this.sheet.showModal();
  }

  /** What is written above the picture, and in file names. */
  get heading(): string {
    return this.name ?? this.player?.capture.name ?? this.opening ?? 'Capture';
  }

  override connectedCallback() {
    super.connectedCallback();
    this.removed = new AbortController();
    const { signal } = this.removed;
    this.sizes.observe(this);
    for (const feature of ['(prefers-color-scheme: dark)', '(prefers-contrast: more)']) {
      matchMedia(feature).addEventListener('change', () => this.applyColors(), { signal });
    }
    const themes = new MutationObserver(() => this.applyColors());
    themes.observe(document.documentElement, { attributeFilter: ['data-theme'] });
    signal.addEventListener('abort', () => themes.disconnect());
    this.addEventListener('keydown', this.pressKey, { signal });
    this.addEventListener('dragover', (event) => this.dragOver(event), { signal });
    this.addEventListener('dragleave', () => (this.dropping = false), { signal });
    this.addEventListener('drop', (event) => this.dropFile(event), { signal });
    // An element that was only moved still has its capture.
    if (this.hasUpdated && !this.player && this.opening === null) this.reopen();
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.removed.abort();
    this.sizes.disconnect();
    clearTimeout(this.restTimer);
    clearTimeout(this.secondTimer);
    queueMicrotask(() => {
      if (this.isConnected) return;
      this.load.abort();
      this.opening = null;
      if (this.player) this.view = this.viewNow(this.player);
      this.unload();
    });
  }

  protected override updated(changed: PropertyValues) {
    if (this.isConnected) this.follow(changed);
    // The canvas is replaced with every capture, so no binding of the template can reach it.
    this.canvas.hidden = !this.player;
    this.canvas.setAttribute(
      'aria-label',
      `${this.heading}: the model, drawn. Drag or use the keys A, D, W, X to turn it.`,
    );
    if (this.measureDeck() !== this.deckHeight || this.editing.panelShare !== this.panelShare) this.resize();
    this.writePlace();
  }

  override render() {
    const { player } = this;
    return html`
      <canvas tabindex="0" role="img" hidden></canvas>
      ${player ? this.overlay(player) : emptyState(this.opening, this.failure, (file) => void this.choose(file))}
      ${
        this.dropping
          ? html`<div class="drop">
              ${player ? 'Drop another capture to play it, or the original frames to compare with' : 'Drop a capture to play it'}
            </div>`
          : nothing
      }
      ${helpSheet(() => this.sheet.close())}
    `;
  }

  private overlay(player: Player) {
    const { capture, transport, progress } = player;
    const { static: part } = capture;
    const act = (action: Action) => perform(action, this);
    const hasErrors = capture.errors.linf.some(Number.isFinite);
    return html`
      ${divider(player)} ${this.marks?.template}
      <div class="lead">
        <slot name="lead"></slot>
        <div class="title glass">
          <h1 title=${this.heading}>${this.heading}</h1>
          <p class="figures">
            ${grouped(part.rest.length / 3)} points, ${grouped(capture.frames)} frames<span class="more"
              >, cage of ${grouped(part.cage.positions.length / 3)} vertices</span
            >${this.editing.hasEdits ? ', edited' : nothing}
          </p>
        </div>
        ${capture.complete ? nothing : this.liveBadge(player)}
      </div>
      ${toolbar(player, act, {
        figures: this.figures,
        editing: this.editing.isOn,
        recording: this.recording !== null,
        recordable: canRecord(),
      })}
      ${this.editing.panel(stem(this))} ${this.figures ? figuresPanel(player) : nothing}
      ${legend(player, this.comparisonActs, this.editing.isOn)}
      ${this.problem !== null ? notice(this.problem, () => (this.problem = null)) : nothing}
      ${
        this.opening !== null
          ? progressBox(`Opening ${this.opening}`, null)
          : progress
            ? progressBox(progress.doing, progress.fraction)
            : player.buffering
              ? progressBox('Loading', null)
              : nothing
      }
      <div class="deck glass">
        ${transportBar(player, act, (speed) => (player.transport = { ...transport, speed }), hasErrors)}
        <cager-timeline
          .frames=${capture.frames}
          .errors=${capture.errors}
          .frameNumbers=${capture.frameNumbers}
          .range=${this.editing.range}
          .look=${this.look}
          .position=${transport.position}
          @seek=${(event: CustomEvent<number>) => (player.transport = sought(player.transport, event.detail))}
        ></cager-timeline>
      </div>
    `;
  }

  private readonly comparisonActs = {
    open: (files: readonly Dropped[]) => void this.openOriginal(files),
    close: () => {
      this.player?.comparison.close();
      this.player?.setHeat('none');
    },
  };

  private liveBadge(player: Player) {
    const place = livePlace(player.capture.live ?? null, player.transport, Date.now());
    const goLive = () => (player.transport = started(sought(player.transport, liveFrame(player.transport))));
    const signIn = () => this.dispatchEvent(new CustomEvent('signin', { bubbles: true, composed: true }));
    clearTimeout(this.secondTimer);
    if (place.kind === 'reconnecting') this.secondTimer = window.setTimeout(() => this.requestUpdate(), 1000);
    return liveBadge(place, goLive, signIn);
  }

  /** Shows what `src`, `capture` and `view` say now. */
  private follow(changed: PropertyValues) {
    if (changed.has('src') && this.src !== null) this.openAddress(this.src);
    else if (changed.get('src')) this.empty();
    if (changed.has('capture') && this.capture) this.show(this.capture);
    else if (changed.get('capture') && this.player?.capture === changed.get('capture')) this.empty();
    if (changed.has('view') && this.view !== '' && this.player) this.goTo(this.view);
  }

  private reopen() {
    if (this.file) void this.open(this.file);
    else if (this.capture) this.show(this.capture);
    else if (this.src !== null) this.openAddress(this.src);
  }

  private openAddress(src: string) {
    const name = fileNameOf(src);
    this.unload();
    void this.openFrom(name, async (signal) => openContainer(await httpSource(src, { signal }), { name, signal }));
  }

  /** Plays a file that somebody dropped or chose, unless its first bytes say that it is no container. */
  private async choose(file: File) {
    try {
      const source = blobSource(file);
      checkPrelude(await source.read(0, Math.min(PRELUDE_BYTES, source.size)));
    } catch (error) {
      if (this.player || this.opening !== null) this.report(error instanceof Error ? error.message : String(error));
      else this.fail(error);
      return;
    }
    const chosen = new CustomEvent('filechosen', { detail: file, bubbles: true, composed: true, cancelable: true });
    if (this.dispatchEvent(chosen)) await this.open(file);
  }

  /** Opens a capture and shows it in place of the present one, which stays if that fails. */
  private async openFrom(name: string, open: (signal: AbortSignal) => Promise<Capture>, file: File | null = null) {
    this.load.abort();
    this.load = new AbortController();
    const { signal } = this.load;
    this.failure = null;
    this.opening = name;
    try {
      const capture = await open(signal);
      if (signal.aborted) {
        capture.close();
        return;
      }
      this.show(capture);
      this.opened = capture;
      this.file = file;
    } catch (error) {
      if (signal.aborted) return;
      if (this.player) {
        this.opening = null;
        this.report(error instanceof Error ? error.message : String(error));
      } else this.fail(error);
    }
  }

  private show(capture: Capture) {
    this.unload();
    this.file = null;
    this.failure = this.problem = this.opening = null;
    // A canvas whose context was given up cannot be used again.
    const canvas = this.canvas.cloneNode() as HTMLCanvasElement;
    this.canvas.replaceWith(canvas);
    canvas.addEventListener('dblclick', () => this.player?.frameAll());
    try {
      canvas.hidden = false;
      this.begin(new Player(canvas, capture));
      this.marks = new PointMarks(this.renderRoot);
      this.marks.follow(canvas, this.player!);
    } catch (error) {
      this.fail(error);
    }
  }

  private begin(player: Player) {
    const view = viewFromText(this.view);
    this.player = player;
    // Blurring what lies below is dear where no graphics processor does it.
    this.toggleAttribute('plain', player.stage.isJagged);
    this.wasReady = false;
    player.onProblem = (problem) => this.report(problem);
    player.onState = () => {
      this.requestUpdate();
      this.announceReady();
    };
    player.onTick = () => this.tick();
    player.controls.onGrab = () => {
      this.cameraWasMoved = true;
      this.canvas.focus();
    };
    this.applyColors();
    this.resize();
    this.take(view, player, true);
    // It is the view of this capture, not of the next one.
    this.view = '';
    if (this.autoplay && view.frame === null && !matchMedia('(prefers-reduced-motion: reduce)').matches) this.play();
    if (player.capture.problem !== null) this.report(player.capture.problem);
  }

  /** Goes to a view; one that names a frame stands there. */
  private take(view: ViewState, player: Player, atOnce: boolean) {
    this.cameraWasMoved = view.camera !== null;
    this.upAxis = view.up;
    player.layers = view.layers;
    player.setUp(view.up);
    if (view.frame !== null) player.transport = { ...sought(player.transport, view.frame), playing: false };
    if (view.camera) player.controls.go(view.camera, atOnce);
    else player.goHome(atOnce);
  }

  /** Shows nothing, as if there never had been a capture. */
  private empty() {
    this.load.abort();
    this.unload();
    this.file = null;
    this.failure = this.problem = this.opening = null;
  }

  private unload() {
    this.recording?.abort();
    this.editing.close();
    this.player?.dispose();
    this.player = null;
    this.opened?.close();
    this.opened = null;
    clearTimeout(this.secondTimer);
  }

  private fail(error: unknown) {
    this.unload();
    this.opening = null;
    this.failure = error instanceof Error ? error.message : String(error);
    this.report(this.failure);
  }

  private announceReady() {
    const { player } = this;
    if (this.wasReady || !player?.stage.decoder.ready) return;
    this.wasReady = true;
    this.dispatchEvent(new CustomEvent('ready', { bubbles: true, composed: true }));
  }

  private tick() {
    const { player } = this;
    if (!player) return;
    if (this.timeline) this.timeline.position = player.transport.position;
    this.editing.draw();
    this.writePlace();
    this.marks?.place(player);
    this.renewBadge(player);
    if (this.frame !== this.shownFrame) {
      this.shownFrame = this.frame;
      this.dispatchEvent(new CustomEvent<number>('framechange', { detail: this.frame, bubbles: true, composed: true }));
    }
    clearTimeout(this.restTimer);
    this.restTimer = window.setTimeout(() => this.tellView(), REST_MILLISECONDS);
  }

  private tellView() {
    const { player } = this;
    if (!player) return;
    const detail = this.viewNow(player);
    this.dispatchEvent(new CustomEvent<string>('viewchange', { detail, bubbles: true, composed: true }));
    if (this.figures) this.requestUpdate();
  }

  private viewNow(player: Player): string {
    return viewText({
      frame: player.transport.playing || this.frame === 0 ? null : this.frame,
      camera: this.cameraWasMoved ? player.controls.destination : null,
      up: this.upAxis,
      layers: player.layers,
    });
  }

  /** Renders anew when playing comes near the newest frame of a running session, or falls behind it. */
  private renewBadge({ capture, transport }: Player) {
    const place = capture.complete ? '' : livePlace(capture.live ?? null, transport, Date.now()).kind;
    if (place !== this.shownPlace) this.requestUpdate();
    this.shownPlace = place;
  }

  /** Writes what changes with every picture: rendering the template sixty times a second would cost more. */
  private writePlace() {
    const { player } = this;
    if (!player) return;
    const write = (selector: string, text: string) => {
      const place = this.renderRoot.querySelector(selector);
      if (place && place.textContent !== text) place.textContent = text;
    };
    const { capture, transport } = player;
    const frame = Math.min(this.frame, Math.max(0, capture.frames - 1));
    const last = Math.max(0, capture.frames - 1);
    write('[data-place]', `${frame} / ${last}`);
    write('[data-clock]', clock(frame / transport.rate));
    // What was measured is not what is shown any more.
    const isEdited = this.editing.changes(frame);
    const figure = (value: number | undefined) =>
      value === undefined || !Number.isFinite(value) || isEdited ? '–' : percent(value);
    write('[data-l2]', figure(capture.errors.l2[frame]));
    write('[data-linf]', figure(capture.errors.linf[frame]));
  }

  private applyColors() {
    this.look++;
    this.player?.stage.setColors(stageColors(this));
    this.player?.refresh();
    this.editing.recolor();
  }

  private measureDeck(): number {
    const deck = this.renderRoot.querySelector('.deck');
    const height = deck ? this.getBoundingClientRect().bottom - deck.getBoundingClientRect().top : 0;
    this.style.setProperty('--deck-height', `${Math.round(height)}px`);
    return Math.round(height);
  }

  private resize() {
    const { clientWidth, clientHeight } = this;
    if (clientWidth === 0 || clientHeight === 0) return;
    const ratio = Math.min(FINEST_PIXEL_RATIO, devicePixelRatio);
    this.deckHeight = this.measureDeck();
    const tools = this.renderRoot.querySelector('.tools')?.clientWidth ?? 0;
    // In a wide picture the tools stand beside the model anyway.
    const isNarrow = clientWidth < NARROW;
    const right = isNarrow ? tools + 12 : 0;
    this.panelShare = this.editing.panelShare;
    const bottom = this.deckHeight + (isNarrow ? Math.round(this.panelShare * clientHeight) : 0);
    this.style.setProperty('--covered-height', `${bottom}px`);
    this.player?.resize(clientWidth, clientHeight, ratio, { right, bottom });
    if (!this.cameraWasMoved) this.player?.goHome(true);
  }

  /** Does what a key asks for; a page that shows nothing else can hand it all key presses. */
  readonly pressKey = (event: KeyboardEvent) => {
    if (event.defaultPrevented || this.sheet.open || this.editing.pressKey(event)) return;
    const target = event.composedPath()[0] as HTMLElement;
    const isControl = /^(BUTTON|A|INPUT|SELECT|LABEL)$/.test(target.tagName);
    // Space and Enter press a button that has the focus; letters choose within a list.
    if (isControl && (event.key === ' ' || event.key === 'Enter' || target.tagName === 'SELECT')) return;
    if (!this.player) return;
    const action = actionOf(event);
    if (!action) return;
    event.preventDefault();
    if (action.startsWith('turn') || action.startsWith('zoom')) this.cameraWasMoved = true;
    perform(action, this);
  };

  private dragOver(event: DragEvent) {
    if (!event.dataTransfer?.types.includes('Files')) return;
    event.preventDefault();
    this.dropping = true;
  }

  private dropFile(event: DragEvent) {
    this.dropping = false;
    const { dataTransfer } = event;
    const file = dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    // Beside an open capture, whatever is no capture itself can only be what it was encoded from.
    if (this.player && !/\.cager$/i.test(file.name)) {
      void this.openOriginal(droppedFiles(dataTransfer));
    } else void this.choose(file);
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'cager-viewer': CagerViewer;
  }
}
