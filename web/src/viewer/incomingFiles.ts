import { html, nothing } from 'lit';
import { isContainer, isUploadable, type Dropped } from '../files/classify';
import { droppedFiles, pickFiles } from '../files/drop';
import { dropHint, dropQuestion } from './messages';
import { checkContainer } from './opener';
import { sentence } from '../text';
import type { ViewerHost } from './host';

export class IncomingFiles {
  private isHeldAbove = false;
  /** A container that was dropped on an open capture, and what came with it. */
  private asked: readonly Dropped[] | null = null;

  constructor(private readonly host: ViewerHost) {}

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

  /** Plays a container among files, unless its first bytes say that it is none; asks where a capture is open, beside which other files are taken. */
  async choose(chosen: readonly Dropped[] | Promise<readonly Dropped[]>) {
    const { host } = this;
    try {
      const files = await chosen;
      const container = files.find(isContainer) ?? (host.isShowing ? undefined : files.at(0));
      if (container && !isContainer(container) && isUploadable(files)) {
        host.offerUpload(files);
        return;
      }
      if (container) await checkContainer(container.file);
      if (!host.isShowing) await this.openInstead(files);
      else if (container) this.asked = files;
      else await host.openFiles(files);
    } catch (error) {
      if (host.isShowing || host.isOpening) host.report(sentence(error));
      else host.fail(error);
    }
    host.requestUpdate();
  }

  /** Asks for a file to show beside the capture. */
  pickBeside() {
    pickFiles((files) => void this.host.openFiles(files, true), { accept: '.cager,.json' });
  }

  /** To be called after every render. */
  follow() {
    const question = this.host.renderRoot.querySelector<HTMLDialogElement>('dialog.question');
    if (question?.open === false) question.showModal();
  }

  template() {
    return html`
      ${this.isHeldAbove ? dropHint(this.host.isShowing) : nothing}
      ${this.asked ? dropQuestion(this.asked.find(isContainer)!.file.name, (choice) => void this.answer(choice)) : nothing}
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
    if (!dataTransfer?.files.length) return;
    event.preventDefault();
    void this.choose(droppedFiles(dataTransfer));
  }

  private async answer(choice: 'instead' | 'beside' | null) {
    const files = this.asked;
    this.asked = null;
    this.host.requestUpdate();
    if (!files) return;
    if (choice === 'instead') await this.openInstead(files);
    if (choice === 'beside') await this.host.openFiles(files, true);
  }

  private async openInstead(files: readonly Dropped[]) {
    const chosen = new CustomEvent('filechosen', { detail: files, bubbles: true, composed: true, cancelable: true });
    if (this.host.dispatchEvent(chosen)) await this.host.openFiles(files);
  }
}
