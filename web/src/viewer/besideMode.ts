import { html, nothing } from 'lit';
import type { Capture, FrameErrors, UpAxis } from '../capture';
import type { Dropped } from '../files/classify';
import { Beside } from './beside';
import { frameText } from './frameNumbers';
import { iconButton } from '../style/parts';
import { openFile } from './opener';
import type { Player } from './player';
import { PointMarks } from './pointMarks';
import { percent, sentence } from '../text';
import { boundsOf } from '../coordinates/topology';
import type { ViewerHost } from './host';
import { upButton } from './toolbar';
import { usualUp } from './upright';

/** A second capture in the viewer, beside the first one: its picture, its name and its errors. */
export class BesideMode {
  pair: Beside | null = null;
  /** Whether both are in the colours of what corresponds to each other. */
  isPainted = false;
  private shown: Capture | null = null;
  private opened: Capture | null = null;
  private marks: PointMarks | null = null;
  private opening = new AbortController();

  constructor(private readonly host: ViewerHost) {}

  /** Shows a file beside the capture, in place of what is there. */
  async open(file: File) {
    this.leave();
    this.opening = new AbortController();
    const { signal } = this.opening;
    try {
      const capture = await openFile(file, signal);
      if (signal.aborted) {
        capture.close();
        return;
      }
      this.opened = this.host.beside = capture;
    } catch (error) {
      if (!signal.aborted) this.host.report(sentence(error));
    }
  }

  /** Shows the first capture alone. */
  leave() {
    this.opening.abort();
    this.unload();
    this.closeFile();
    if (!this.host.beside) return;
    this.host.beside = this.host.besideUp = null;
    this.host.dispatchEvent(new CustomEvent('besideclosed', { bubbles: true, composed: true }));
  }

  get player(): Player | null {
    return this.pair?.player ?? null;
  }

  get errors(): FrameErrors | null {
    return this.pair?.errors ?? null;
  }

  /** Takes the frames that both captures were encoded from. */
  async openOriginal(files: readonly Dropped[]) {
    const { player } = this;
    if (!player) return;
    try {
      await player.comparison.open(files);
    } catch (error) {
      this.host.report(`${player.capture.name}: ${sentence(error)}`);
    }
  }

  /** To be called after every render: fills the second picture, or forgets it when only one is shown. */
  follow() {
    const { player, beside } = this.host;
    const pane = this.host.renderRoot.querySelector<HTMLElement>('.pane.second');
    if (!player || !beside || !pane) {
      this.unload();
      return;
    }
    if (this.shown === beside) return;
    this.unload();
    if (this.opened !== beside) this.closeFile();
    this.shown = beside;
    const canvas = document.createElement('canvas');
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', `${beside.name}: second 3D view`);
    pane.prepend(canvas);
    try {
      this.pair = new Beside(canvas, beside, player);
      this.begin(this.pair.player, player, pane);
    } catch (error) {
      this.leave();
      this.host.report(sentence(error));
    }
  }

  /** Paints what corresponds to each other in both pictures in one colour. Throws one sentence for a person where the report is not of these two. */
  paint(correspondence: readonly number[]) {
    const { player: first } = this.host;
    const { player: second } = this;
    if (!first || !second) throw new Error('Show source and target side by side first: drop the other one here.');
    paintCorrespondence(correspondence, first, second);
    this.isPainted = true;
    first.layers = { ...first.layers, colors: true };
    first.setHeat('none');
  }

  unload() {
    if (this.isPainted) this.host.player?.stage.paint(null);
    this.isPainted = false;
    this.pair?.player.stage.canvas.remove();
    this.pair?.dispose();
    this.pair = this.shown = this.marks = null;
  }

  /** The second picture, which {@link follow} fills. */
  template() {
    if (!this.host.beside) return nothing;
    const { pair } = this;
    const progress = pair?.player.progress;
    return html`<div class="pane second">
      ${this.marks?.template ?? nothing}
      <section class="caption corner glass" aria-label="Second capture">
        <h2 class="heading clip" title=${this.host.beside.name}>${this.host.beside.name}</h2>
        ${iconButton('close', 'Close the second capture', () => this.leave())}
        <p class="figures fine">
          <i class="dashes" title="Dashed line in the timeline"></i
          >${progress ? `${progress.doing} ${Math.round(100 * (progress.fraction ?? 0))} %` : nothing}
          <span data-beside ?hidden=${Boolean(progress)}></span>
        </p>
        ${this.isPainted ? html`<p class="fine">Matching colours mark corresponding points</p>` : nothing}
        ${pair ? upButton(pair.player.up, (up) => this.setUp(up)) : nothing}
      </section>
    </div>`;
  }

  /** Takes the axis that points up, the capture's own where none was chosen. */
  settleUp() {
    this.player?.setUp(this.host.besideUp ?? usualUp(this.player.capture.static));
  }

  /** To be called after every picture. */
  draw() {
    const { pair, host } = this;
    if (!pair) return;
    this.marks?.place(pair.player);
    const place = host.renderRoot.querySelector('[data-beside]');
    const text = figures(pair, host.player!);
    if (place && place.textContent !== text) place.textContent = text;
  }

  private setUp(up: UpAxis) {
    const { player } = this;
    if (!player) return;
    this.host.besideUp = up === usualUp(player.capture.static) ? null : up;
    this.settleUp();
  }

  private closeFile() {
    this.opened?.close();
    this.opened = null;
  }

  private begin(player: Player, lead: Player, pane: HTMLElement) {
    player.onProblem = (problem) => {
      if (problem !== null) this.host.report(`${player.capture.name}: ${problem}`);
    };
    player.onRecovery = (problem) => this.host.recover(`${player.capture.name}: ${problem}`);
    player.onState = () => this.host.requestUpdate();
    player.controls.onGrab = () => lead.controls.onGrab();
    this.settleUp();
    this.marks = new PointMarks(pane);
    this.marks.follow(player.stage.canvas, player);
    if (lead.comparison.isOpen) void this.openOriginal(lead.comparison.files);
    this.host.applyColors();
    const correspondence = lead.capture.correspondence ?? player.capture.correspondence;
    try {
      if (correspondence) this.paint(correspondence);
    } catch (error) {
      this.host.report(sentence(error));
    }
  }
}

function figures({ frame, player }: Beside, lead: Player): string {
  const { numbers, position } = lead.transport;
  const number = frameText(numbers, Math.floor(position));
  if (frame === null) return `No frame ${number} here`;
  const { l2, linf } = player.capture.errors;
  return Number.isFinite(linf[frame]) ? `L2 ${percent(l2[frame])} · L∞ ${percent(linf[frame])}` : `frame ${number}`;
}

/** Darkest and brightest value of a colour's channels: light and shadow are seen on all. */
const [DARK, BRIGHT] = [40, 245];

/**
 * Paints a source by the places of its points at rest, and a target with the colours of the points that correspond to its own. Either may be the source; of two
 * with as many points it is the first.
 *
 * @param correspondence the source's point for each of the target's
 * @throws Error with one sentence for a person where it is not of these two
 */
function paintCorrespondence(correspondence: readonly number[], first: Player, second: Player) {
  const pointsOf = ({ capture }: Player) => capture.static.rest.length / 3;
  const [source, target] = pointsOf(second) === correspondence.length ? [first, second] : [second, first];
  const count = pointsOf(source);
  if (pointsOf(target) !== correspondence.length || correspondence.some((point) => point >= count))
    throw new Error('This report is about other models: open the source and the transferred target.');
  const colors = placeColors(source.capture.static);
  const taken = new Uint8Array(3 * correspondence.length);
  for (const [k, point] of correspondence.entries()) taken.set(colors.subarray(3 * point, 3 * point + 3), 3 * k);
  source.stage.paint(colors);
  target.stage.paint(taken);
}

/** Red, green and blue of each point by where it is between the ends of the model: along x, y and z. */
export function placeColors({ rest }: Pick<Capture['static'], 'rest'>): Uint8Array {
  const { low, high } = boundsOf(rest);
  return Uint8Array.from(rest, (x, k) => {
    const share = (x - low[k % 3]) / (high[k % 3] - low[k % 3] || 1);
    return Math.round(DARK + (BRIGHT - DARK) * share);
  });
}
