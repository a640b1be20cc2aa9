import type { Capture, UpAxis } from '../capture';
import { html, nothing, type PropertyValues } from 'lit';
import { customElement, property, query, state } from 'lit/decorators.js';
import { EditMode } from '../editing/editMode';
import { controls } from '../style/controls';
import { tokens } from '../style/tokens';
import { isContainer, type Dropped } from '../files/classify';
import { perform, stem } from './actions';
import { BesideMode } from './besideMode';
import { CaptureElement } from './captureElement';
import { divider } from './comparisonParts';
import { deckStyle } from './deckStyle';
import { exportPanel } from './exports';
import { figuresPanel } from './figuresPanel';
import { IncomingFiles } from './incomingFiles';
import { Layout } from './layout';
import { LiveBadge } from './liveBadge';
import { emptyState, notice, progressBox } from './messages';
import { overlayStyle } from './overlayStyle';
import { helpSheet } from './helpSheet';
import { deck, legend, titleBox, writeReadout } from './parts';
import type { Player } from './player';
import { partsPanel } from './partsPanel';
import { PointMarks } from './pointMarks';
import { PoseMode } from './poseMode';
import { correspondenceOf, readReport, trackingOf } from './reports';
import { actionOfKey, type Action } from './shortcuts';
import { followLooks, stageColors } from './stageColors';
import { sentence } from '../text';
import type { Timeline } from './timeline';
import { toolbar } from './toolbar';
import { viewsPanel } from './viewsPanel';
import { viewerStyle } from './viewerStyle';

type Panel = 'figures' | 'views' | 'export' | 'parts';

/** How long what was done is said. */
const SAID_MILLISECONDS = 2000;

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
 * @fires filechosen with files that somebody dropped or chose, a container among them; whoever cancels it sees to them
 * @fires besidewanted when somebody wants to see another capture beside this one; whoever cancels it sets `beside`, else a file is asked for
 * @fires besideclosed when somebody wants to see this capture alone again
 * @fires uploadwanted with files that are no capture yet, when somebody wants to upload them; offered where `uploads` is set
 * @fires signin when somebody wants to sign in, to follow a session on
 */
@customElement('cager-viewer')
export class CagerViewer extends CaptureElement {
  static override styles = [tokens, controls, viewerStyle, deckStyle, overlayStyle];

  @state() private panel: Panel | null = null;
  @state() private said = '';
  @state() recording: AbortController | null = null;
  @query('cager-timeline') private readonly timeline!: Timeline | null;
  @query('dialog.sheet') private readonly sheet!: HTMLDialogElement;
  /** Whether the address of the page leads back to what is shown. */
  @property({ type: Boolean }) linkable = false;
  /** Whether the page around it takes files to upload: `uploadwanted`. */
  @property({ type: Boolean }) uploads = false;
  /** Files that were dropped and are no capture yet. */
  @state() private uploadable: readonly Dropped[] | null = null;
  /** A second capture to show beside the first; whoever sets it closes it. */
  @property({ attribute: false }) beside: Capture | null = null;
  readonly editing = new EditMode(this);
  readonly poses = new PoseMode(this);
  readonly pair = new BesideMode(this);
  private readonly files = new IncomingFiles(this);
  private readonly live = new LiveBadge(this);
  private readonly layout = new Layout(this);
  private marks: PointMarks | null = null;
  private removed = new AbortController();
  private readonly sizes = new ResizeObserver(() => this.resize());

  /** Takes the frames that the capture was encoded from, or the surfaces that it was recovered from, and shows how far it is from them. */
  async openOriginal(files: readonly Dropped[]): Promise<void> {
    const { player } = this;
    if (!player) return;
    try {
      await player.comparison.open(files);
      await this.pair.openOriginal(player.comparison.files);
      if (player.heatMap.kind !== 'error') player.setHeat('error');
      this.problem = null;
    } catch (error) {
      this.report(sentence(error));
    }
  }

  /**
   * Plays the first container among files, or shows it beside the open capture, and a second one beside the first; then takes a report of the program and what
   * a capture was encoded or recovered from.
   */
  async openFiles(files: readonly Dropped[], beside = false): Promise<void> {
    const named = files.filter(isContainer);
    const containers = named.length > 0 || this.isShowing ? named : files.slice(0, 1);
    for (const [k, { file }] of containers.slice(0, beside ? 1 : 2).entries())
      await (beside || k > 0 ? this.openBeside(file) : this.open(file));
    const reports = files.filter(({ path }) => /\.json$/i.test(path));
    for (const { file } of reports) await this.openReport(file);
    const others = files.filter((each) => !containers.includes(each) && !reports.includes(each));
    if (others.length > 0) await this.openOriginal(others);
  }

  /** Takes what a report of the program tells of the capture. */
  async openReport(file: File): Promise<void> {
    const { player } = this;
    if (!player) return;
    try {
      const report = await readReport(file);
      const correspondence = correspondenceOf(report);
      // A second picture that is to come is there after the next render.
      await this.updateComplete;
      if (correspondence) this.pair.paint(correspondence);
      else player.capture.tracking = trackingOf(report, player.capture.frames);
      player.refresh();
      this.problem = null;
    } catch (error) {
      this.report(sentence(error));
    }
  }

  openBeside(file: File): Promise<void> {
    return this.pair.open(file);
  }

  /** Shows the capture alone where there is another one beside it; else asks for one. */
  toggleBeside() {
    if (this.beside) {
      this.pair.leave();
      return;
    }
    const wanted = new CustomEvent('besidewanted', { bubbles: true, composed: true, cancelable: true });
    if (this.dispatchEvent(wanted)) this.files.pickBeside();
  }

  toggleEditing(): Promise<void> {
    this.poses.leave();
    return this.editing.toggle();
  }

  /** Shows the model between poses, or as its frames are again; editing it ends. */
  async togglePoses(): Promise<void> {
    if (this.editing.isOn) await this.editing.toggle();
    await this.poses.toggle();
  }

  togglePanel(panel: Panel) {
    this.panel = this.panel === panel ? null : panel;
  }

  say(sentence: string) {
    this.said = sentence;
    setTimeout(() => (this.said = ''), SAID_MILLISECONDS);
  }

  override goTo(text: string) {
    super.goTo(text);
    this.pair.settleUp();
  }

  get besideUp(): UpAxis | null {
    return this.link.besideUp;
  }

  set besideUp(up: UpAxis | null) {
    this.link.besideUp = up;
    this.link.touch();
  }

  /** The view as `viewchange` tells it. */
  get viewText(): string {
    return this.player ? this.link.textOf(this.player) : '';
  }

  override fail(error: unknown) {
    this.uploadable = null;
    super.fail(error);
  }

  offerUpload(files: readonly Dropped[]) {
    const { name } = files[0].file;
    const what = files.length === 1 ? `${name} is` : `${name} and ${files.length - 1} more are`;
    this.fail(
      new Error(`${what} not encoded yet. ${this.uploads ? 'Upload to play it.' : 'Encode with “cager encode”.'}`),
    );
    this.uploadable = files;
  }

  openHelp() {
    this.sheet.showModal();
  }

  override connectedCallback() {
    super.connectedCallback();
    this.removed = new AbortController();
    const { signal } = this.removed;
    this.sizes.observe(this);
    followLooks(() => this.applyColors(), signal);
    this.addEventListener('keydown', this.pressKey, { signal });
    this.files.listen(signal);
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.removed.abort();
    this.sizes.disconnect();
    this.live.stop();
  }

  protected override updated(changed: PropertyValues) {
    super.updated(changed);
    this.pair.follow();
    this.files.follow();
    // The canvas is replaced with every capture, so no binding of the template can reach it.
    this.canvas.hidden = !this.player;
    this.canvas.setAttribute('aria-label', `${this.heading}: 3D view. Drag, or press A, D, W or X, to orbit.`);
    if (this.layout.hasChanged(this.pair.player, this.coveredShare)) this.resize();
    this.writePlace();
  }

  override render() {
    const { player, opener } = this;
    return html`
      <div class="pane first">
        <canvas tabindex="0" role="img" hidden></canvas>
        ${player ? [divider(player), this.marks?.template] : nothing}
      </div>
      ${
        // A capture that is edited has the viewer for itself.
        player && !this.editing.isOn ? this.pair.template() : nothing
      }
      ${
        player
          ? this.overlay(player)
          : emptyState(
              opener.name,
              opener.failure,
              (files) => void this.files.choose(files),
              this.uploads && opener.failure !== null && this.uploadable ? this.upload : null,
            )
      }
      ${helpSheet(() => this.sheet.close())} ${this.files.template()}
    `;
  }

  private readonly upload = () => this.tell('uploadwanted', this.uploadable);

  private overlay(player: Player) {
    const { capture, progress } = player;
    const act = (action: Action) => perform(action, this);
    const opening = this.opener.name;
    const isEdited = this.editing.hasEdits || capture.layers?.some(({ isOn }) => isOn) === true;
    const close = () => (this.panel = null);
    return html`
      <div class="lead corner">
        <slot name="lead"></slot>
        ${titleBox(this.heading, player, isEdited, (up) => (this.up = up))}
        ${capture.complete ? nothing : this.live.template(player)}
      </div>
      ${toolbar(player, act, {
        colors:
          this.pair.isPainted || [player, this.pair.player].some((shown) => shown?.capture.static.colors !== undefined),
        materials: [player, this.pair.player].some((shown) => shown?.surface.hasMaterials === true),
        parts: player.surface.parts ? this.panel === 'parts' : null,
        figures: this.panel === 'figures',
        views: this.panel === 'views',
        editing: this.editing.isOn,
        beside: this.beside !== null,
        poses: this.poses.isOn,
        recording: this.recording !== null,
        exports: this.panel === 'export',
        linkable: this.linkable,
      })}
      ${this.editing.panel(stem(this))} ${this.poses.panel()}
      ${this.panel === 'figures' ? figuresPanel(player, close) : nothing}
      ${this.panel === 'views' ? viewsPanel(player, this, close) : nothing}
      ${this.panel === 'parts' && player.surface.parts ? partsPanel(player, player.surface.parts, close) : nothing}
      ${this.panel === 'export' ? exportPanel(player, this, close) : nothing}
      ${legend(player, this.comparisonActs, this.panelShare > 0)}
      <div class="messages">
        ${this.problem !== null ? notice(this.problem, () => (this.problem = null)) : nothing}
        ${
          opening !== null
            ? progressBox(`Opening ${opening}`, null)
            : progress
              ? progressBox(progress.doing, progress.fraction)
              : this.said !== ''
                ? progressBox(this.said, null)
                : player.playback.buffering
                  ? progressBox('Loading', null)
                  : nothing
        }
      </div>
      ${deck(player, act, {
        besideErrors: this.pair.errors,
        range: this.editing.range,
        edited: this.editing.hasEdits ? (frame) => this.editing.changes(frame) : null,
      })}
    `;
  }

  private readonly comparisonActs = {
    open: (files: readonly Dropped[]) => void this.openOriginal(files),
    close: () => {
      this.player?.comparison.close();
      this.player?.setHeat('none');
    },
  };

  protected override began(player: Player) {
    // Blurring what lies below is dear where no graphics processor does it.
    this.toggleAttribute('plain', player.stage.isJagged);
    this.marks = new PointMarks(this.canvas.parentElement!);
    this.marks.follow(this.canvas, player);
    this.applyColors();
    this.resize();
    this.editing.open(player);
  }

  protected override unload() {
    this.recording?.abort();
    this.editing.close();
    this.poses.close();
    this.pair.unload();
    super.unload();
    this.live.stop();
  }

  protected override tick() {
    const { player } = this;
    if (!player) return;
    if (this.timeline) this.timeline.position = player.transport.position;
    this.editing.draw();
    this.writePlace();
    this.marks?.place(player);
    this.style.setProperty('--line', `${player.stage.line}px`);
    this.live.follow(player);
    this.pair.draw();
    super.tick();
  }

  override tellView() {
    super.tellView();
    if (this.panel) this.requestUpdate();
  }

  private writePlace() {
    const { player } = this;
    const isChanged = (frame: number) => player?.playback.shape !== null || this.editing.changes(frame);
    if (player) writeReadout(this.renderRoot, player, isChanged);
  }

  applyColors() {
    const colors = stageColors(this);
    for (const player of [this.player, this.pair.player]) {
      player?.stage.setColors(colors);
      player?.refresh();
    }
    this.editing.recolor();
  }

  /** Part of a narrow picture's height that a panel takes. */
  private get panelShare(): number {
    return Math.max(this.editing.panelShare, this.poses.panelShare);
  }

  /** The same with the panel of a comparison, and with that of parts, which are to be seen as they are switched. */
  private get coveredShare(): number {
    const ofParts = this.panel === 'parts' && this.player?.surface.parts ? 0.34 : 0;
    return Math.max(this.panelShare, this.player?.comparison.isOpen ? 0.2 : 0, ofParts);
  }

  private resize() {
    this.layout.apply(this.player, this.pair.player, this.coveredShare);
    this.player?.refit(true);
  }

  /** Does what a key asks for; a page that shows nothing else can hand it all key presses. */
  readonly pressKey = (event: KeyboardEvent) => {
    if (event.defaultPrevented || this.sheet.open || this.files.isAsking) return;
    if (this.editing.pressKey(event)) return;
    const action = this.player && actionOfKey(event);
    if (!action) return;
    event.preventDefault();
    perform(action, this);
  };
}

declare global {
  interface HTMLElementTagNameMap {
    'cager-viewer': CagerViewer;
  }
}
