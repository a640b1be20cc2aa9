import { html, nothing } from 'lit';
import type { Dropped } from '../upload/classify';
import { droppedFiles } from '../upload/drop';
import { dropHint, dropQuestion } from './messages';
import { checkContainer } from './opener';
import { sentence } from './text';

/** What taking files needs of the viewer around it. */
export interface FilesHost extends HTMLElement {
  readonly renderRoot: ParentNode;
  /** Whether a capture is shown. */
  readonly isShowing: boolean;
  /** Whether one is being opened. */
  readonly isOpening: boolean;
  open(file: File): Promise<void>;
  openBeside(file: File): Promise<void>;
  openOriginal(files: Promise<readonly Dropped[]>): Promise<void>;
  fail(error: unknown): void;
  report(problem: string): void;
  requestUpdate(): void;
}

/** Files that somebody drops on the viewer or chooses, and what is done with them. */
export class IncomingFiles {
  private isHeldAbove = false;
  /** A container that was dropped on an open capture. */
  private asked: File | null = null;

  constructor(private readonly host: FilesHost) {}

  /** Whether somebody is asked what is to be done with a file. */
  get isAsking(): boolean {
    return this.asked !== null;
  }

  /** Takes files that are dropped until the signal is aborted. */
  listen(signal: AbortSignal) {
    const { host } = this;
    const over = (event: DragEvent) => {
      if (!event.dataTransfer?.types.includes('Files')) return;
      event.preventDefault();
      this.hold(true);
    };
    host.addEventListener('dragover', over, { signal });
    host.addEventListener('dragleave', () => this.hold(false), { signal });
    host.addEventListener('drop', (event) => this.take(event), { signal });
  }

  /** Plays a file, unless its first bytes say that it is no container; asks where a capture is open. */
  async choose(file: File) {
    const { host } = this;
    try {
      await checkContainer(file);
    } catch (error) {
      if (host.isShowing || host.isOpening) host.report(sentence(error));
      else host.fail(error);
      return;
    }
    if (host.isShowing) this.asked = file;
    else await this.openInstead(file);
    host.requestUpdate();
  }

  /** Asks for a file to show beside the capture. */
  pickBeside() {
    this.host.renderRoot.querySelector<HTMLInputElement>('.beside-file')!.click();
  }

  /** To be called after every render. */
  follow() {
    const question = this.host.renderRoot.querySelector<HTMLDialogElement>('dialog.question');
    if (question?.open === false) question.showModal();
  }

  template() {
    return html`
      ${this.isHeldAbove ? dropHint(this.host.isShowing) : nothing}
      ${this.asked ? dropQuestion(this.asked.name, (choice) => void this.answer(choice)) : nothing}
      <input class="beside-file" type="file" accept=".cager" hidden @change=${this.takeBeside} />
    `;
  }

  private hold(isHeldAbove: boolean) {
    if (isHeldAbove === this.isHeldAbove) return;
    this.isHeldAbove = isHeldAbove;
    this.host.requestUpdate();
  }

  private take(event: DragEvent) {
    this.hold(false);
    const { dataTransfer } = event;
    const file = dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    // Beside an open capture, whatever is no capture itself can only be what it was encoded from.
    if (this.host.isShowing && !/\.cager$/i.test(file.name)) void this.host.openOriginal(droppedFiles(dataTransfer));
    else void this.choose(file);
  }

  private async answer(choice: 'instead' | 'beside' | null) {
    const file = this.asked;
    this.asked = null;
    this.host.requestUpdate();
    if (!file) return;
    if (choice === 'instead') await this.openInstead(file);
    if (choice === 'beside') await this.host.openBeside(file);
  }

  private readonly takeBeside = (event: Event) => {
    const input = event.target as HTMLInputElement;
    const file = input.files?.[0];
    input.value = '';
    if (file) void this.host.openBeside(file);
  };

  private async openInstead(file: File) {
    const chosen = new CustomEvent('filechosen', { detail: file, bubbles: true, composed: true, cancelable: true });
    if (this.host.dispatchEvent(chosen)) await this.host.open(file);
  }
}
