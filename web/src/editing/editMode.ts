import { html, nothing } from 'lit';
import type { Player } from '../viewer/player';
import { counts, weightAt, type FrameRange } from './cageEdit';
import type { CageEditor } from './editor';

/** What edit mode needs of the viewer around it. */
export interface EditHost extends HTMLElement {
  readonly player: Player | null;
  readonly renderRoot: HTMLElement | DocumentFragment;
  requestUpdate(): void;
  report(problem: string): void;
}

/** Edit mode of a viewer: loads the editor when it is first used, and answers for it until it is loaded. */
export class EditMode {
  isOn = false;
  editor: CageEditor | null = null;
  /** Whether the cage was shown before. */
  private showedCage = false;

  constructor(private readonly host: EditHost) {}

  /** Part of a narrow picture's height that the panel takes, as its style says. */
  get panelShare(): number {
    return this.isOn ? 0.38 : 0;
  }

  /** Whether the capture is shown with edits. */
  get hasEdits(): boolean {
    return this.editor?.model.edits.some(counts) ?? false;
  }

  /** Whether an edit changes a frame. */
  changes(frame: number): boolean {
    return this.editor?.model.edits.some((edit) => counts(edit) && weightAt(edit.range, frame) > 0) ?? false;
  }

  /** The range of the edit that is worked on. */
  get range(): FrameRange | null {
    return this.isOn ? (this.editor?.model.active?.range ?? null) : null;
  }

  /** Begins to edit, or ends it: what was edited stays in the picture. */
  async toggle() {
    const { player } = this.host;
    if (!player) return;
    if (this.isOn) {
      this.isOn = false;
      this.editor?.hide();
      if (!this.showedCage) player.layers = { ...player.layers, cage: false };
      this.host.requestUpdate();
      return;
    }
    try {
      const { CageEditor } = await import('./index');
      if (this.host.player !== player) return;
      this.editor ??= new CageEditor(this.host, player);
      this.editor.addEventListener('leave', this.leave);
      this.editor.addEventListener('change', this.follow);
    } catch {
      this.host.report('The editor could not be loaded; reload the page when the service answers again.');
      return;
    }
    this.isOn = true;
    this.showedCage = player.layers.cage;
    player.layers = { ...player.layers, cage: true };
    this.editor.show();
    player.stage.canvas.focus({ preventScroll: true });
    this.host.requestUpdate();
  }

  /** The editor's panel. */
  panel(name: string) {
    if (!this.isOn || !this.editor) return nothing;
    const report = (event: CustomEvent<string>) => this.host.report(event.detail);
    return html`<cager-edit-panel
      .editor=${this.editor}
      .name=${name}
      @leave=${this.leave}
      @problem=${report}
    ></cager-edit-panel>`;
  }

  /** Hands a key press to the editor; whether it was for it. */
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

  /** Forgets the capture and its edits. */
  close() {
    this.editor?.dispose();
    this.editor = null;
    this.isOn = false;
  }

  private readonly leave = () => {
    if (this.isOn) void this.toggle();
  };

  private readonly follow = () => this.host.requestUpdate();
}
