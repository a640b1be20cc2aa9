import { html, nothing } from 'lit';
import type { Player } from '../viewer/player';
import { counts, weightAt, type FrameRange } from './cageEdit';
import { EditKeeper } from './editKeeper';
import type { CageEditor } from './editor';
import './keptOffer';

/** What the timeline shows before there is an edit: a strip without a range. */
const NO_FRAMES: FrameRange = { first: 0, last: -1, easeIn: 0, easeOut: 0 };

export interface EditHost extends HTMLElement {
  readonly player: Player | null;
  readonly renderRoot: HTMLElement | DocumentFragment;
  requestUpdate(): void;
  readonly updateComplete: Promise<boolean>;
  report(problem: string): void;
}

/** Edit mode of a viewer: loads the editor when it is first used, and answers for it until it is loaded. */
export class EditMode {
  isOn = false;
  editor: CageEditor | null = null;
  private showedCage = false;
  private keeper: EditKeeper | null = null;

  constructor(private readonly host: EditHost) {
    host.addEventListener('rangechange', (event) => this.setRange((event as CustomEvent<FrameRange>).detail));
    host.addEventListener('rangeend', () => this.editor?.model.endStep());
  }

  /** To be called with every capture that is shown: looks for edits of it that were left. */
  open(player: Player) {
    this.keeper = new EditKeeper(player, () => this.host.requestUpdate());
  }

  get panelShare(): number {
    return this.isOn ? 0.38 : 0;
  }

  get hasEdits(): boolean {
    return this.editor?.model.edits.some(counts) ?? false;
  }

  changes(frame: number): boolean {
    return this.editor?.model.edits.some((edit) => counts(edit) && weightAt(edit.range, frame) > 0) ?? false;
  }

  /** The range of the edit that is worked on; without frames where there is no such edit, null while nothing is edited. */
  get range(): FrameRange | null {
    return this.isOn ? (this.editor?.model.active?.range ?? NO_FRAMES) : null;
  }

  /** Begins to edit, or ends it: what was edited stays in the picture. */
  async toggle() {
    const { player } = this.host;
    if (!player) return;
    if (this.isOn) {
      this.isOn = false;
      this.editor?.hide();
      if (!this.showedCage) player.layers = { ...player.layers, cage: false };
      await this.relayout();
      return;
    }
    try {
      const { CageEditor } = await import('./index');
      if (this.host.player !== player) return;
      this.editor ??= new CageEditor(this.host, player);
      this.editor.addEventListener('leave', this.leave);
      this.editor.addEventListener('change', this.follow);
    } catch {
      this.host.report('The editor could not be loaded. Check your connection and reload.');
      return;
    }
    this.isOn = true;
    this.showedCage = player.layers.cage;
    player.layers = { ...player.layers, cage: true };
    this.editor.show();
    player.stage.canvas.focus({ preventScroll: true });
    await this.relayout();
  }

  panel(name: string) {
    return html`${this.offer()}${this.controls(name)}`;
  }

  private offer() {
    const { keeper } = this;
    if (!keeper?.offer) return nothing;
    return html`<cager-kept-offer
      .kept=${keeper.offer}
      @takeup=${() => void this.takeUp()}
      @throwaway=${() => keeper.throwAway()}
    ></cager-kept-offer>`;
  }

  private controls(name: string) {
    if (!this.isOn || !this.editor) return nothing;
    const report = (event: CustomEvent<string>) => this.host.report(event.detail);
    return html`<cager-edit-panel
      .editor=${this.editor}
      .name=${name}
      .keeping=${this.keeper?.keeping ?? 'kept'}
      @leave=${this.leave}
      @problem=${report}
    ></cager-edit-panel>`;
  }

  pressKey(event: KeyboardEvent): boolean {
    return this.isOn && (this.editor?.pressKey(event) ?? false);
  }

  /** To be called after every picture. */
  draw() {
    if (this.isOn) this.editor?.draw();
  }

  /** To be called when colours have changed. */
  recolor() {
    if (this.isOn) this.editor?.recolor();
  }

  close() {
    this.keeper?.close();
    this.editor?.dispose();
    this.keeper = this.editor = null;
    this.isOn = false;
  }

  private readonly leave = () => {
    if (this.isOn) void this.toggle();
  };

  private readonly follow = () => {
    if (this.editor) this.keeper?.note(this.editor.model.edits);
    this.host.requestUpdate();
  };

  private async takeUp() {
    if (!this.isOn) await this.toggle();
    if (this.editor && this.keeper) this.editor.model.takeUp(this.keeper.take());
    this.host.requestUpdate();
  }

  private setRange(range: FrameRange) {
    const { active } = this.editor?.model ?? {};
    if (active) this.editor?.model.setRange(active.id, range, this.editor.player.capture.frames);
  }

  /** Renders twice: how high the timeline is shows after the first time. */
  private async relayout() {
    this.host.requestUpdate();
    await this.host.updateComplete;
    this.host.requestUpdate();
  }
}
