import { html, nothing, css, LitElement } from 'lit';
import type { Player } from '../viewer/player';
import { counts, weightAt, type FrameRange } from './cageEdit';
import { EditKeeper } from './editKeeper';
import type { CageEditor } from './editor';
import { customElement, property, query } from 'lit/decorators.js';
import { controls } from '../style/controls';
import { counted } from '../text';
import type { KeptEdits } from './keptEdits';
import type { ViewerHost } from '../viewer/host';

/**
 * Says that a capture has edits from before.
 *
 * @fires takeup when they are to be there again
 * @fires throwaway when they are to be forgotten, and somebody was asked whether they are
 */
@customElement('cager-kept-offer')
export class KeptOffer extends LitElement {
  static override styles = [
    controls,
    css`
      :host {
        position: absolute;
        z-index: 3;
        top: var(--cager-space-3);
        left: 50%;
        translate: -50% 0;
        display: flex;
        flex-wrap: wrap;
        align-items: center;
        justify-content: center;
        gap: var(--cager-space-2) var(--cager-space-3);
        width: max-content;
        max-width: min(460px, calc(100% - 2 * 90px));
        padding: var(--cager-space-2) var(--cager-space-3);
        border: 1px solid color-mix(in srgb, var(--cager-accent) 60%, transparent);
        border-radius: var(--cager-radius-large);
        background: var(--cager-surface);
        box-shadow: var(--cager-shadow);
      }
      p {
        flex: 1 1 220px;
      }
      .buttons {
        margin-top: var(--cager-space-4);
      }
      @container (max-width: 1000px) {
        :host {
          top: calc(var(--cager-space-3) + 64px);
        }
      }
      @container (max-width: 680px) {
        :host {
          left: var(--cager-space-2);
          max-width: calc(100% - 2 * var(--cager-space-2) - 62px);
          translate: none;
        }
      }
    `,
  ];

  @property({ attribute: false }) kept!: KeptEdits;
  @query('dialog') private readonly dialog!: HTMLDialogElement;

  override render() {
    const { edits, changed } = this.kept;
    const when = new Date(changed).toLocaleString(undefined, { dateStyle: 'medium', timeStyle: 'short' });
    return html`
      <p role="status">${counted(edits.length, 'edit')} kept in this browser, from ${when}</p>
      <div class="row">
        <button class="primary" @click=${() => this.dispatchEvent(new Event('takeup'))}>Restore</button>
        <button @click=${() => this.dialog.showModal()}>Discard</button>
      </div>
      <dialog aria-labelledby="discard" @keydown=${(event: Event) => event.stopPropagation()}>
        <form method="dialog">
          <h2 id="discard">Discard ${counted(edits.length, 'edit')}?</h2>
          <p>They are permanently deleted from this browser.</p>
          <div class="buttons">
            <button autofocus>Cancel</button>
            <button type="button" class="danger" @click=${() => this.dispatchEvent(new Event('throwaway'))}>
              Discard
            </button>
          </div>
        </form>
      </dialog>
    `;
  }
}

/** What the timeline shows before there is an edit: a strip without a range. */
const NO_FRAMES: FrameRange = { first: 0, last: -1, easeIn: 0, easeOut: 0 };

/** Edit mode of a viewer: loads the editor when it is first used, and answers for it until it is loaded. */
export class EditMode {
  isOn = false;
  editor: CageEditor | null = null;
  private showedCage = false;
  private keeper: EditKeeper | null = null;

  constructor(private readonly host: ViewerHost) {
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
