import { css, html, LitElement, nothing } from 'lit';
import { customElement, query, state } from 'lit/decorators.js';
import { pickFiles } from '../files/drop';
import type { Session } from '../service/messages';
import { problemBehind, sentenceOf, ServiceProblem } from '../service/problem';
import type { Service } from '../service/service';
import { nameOf } from '../sessions/row';
import { controls } from '../style/controls';
import { glyphs } from '../style/glyphs';
import { count } from '../text';
import { iconButton } from '../style/parts';

/** What to show beside a capture: a session by its id, or a file. */
export type CompareChoice = { readonly session: string } | { readonly file: File };

/**
 * Asks what to show beside a session: another one of the list, or a file.
 *
 * @fires compare with the {@link CompareChoice}
 */
@customElement('cager-compare-dialog')
export class CompareDialog extends LitElement {
  static override styles = [
    controls,
    css`
      dialog {
        width: min(520px, calc(100vw - 24px));
      }
      input[type='search'] {
        width: 100%;
      }
      ul {
        margin: var(--cager-space-2) 0;
        max-height: min(46dvh, 360px);
        overflow: auto;
      }
      li button {
        justify-content: space-between;
        width: 100%;
        min-height: 44px;
      }
      footer {
        margin-top: var(--cager-space-3);
      }
    `,
  ];

  @state() private sessions: readonly Session[] = [];
  @state() private next: string | null = null;
  @state() private isLoading = false;
  @state() private problem: string | null = null;
  @state() private wanted = '';
  @query('dialog') private readonly dialog!: HTMLDialogElement;
  private service: Service | null = null;
  private shown: string | null = null;

  /** Opens it, for what is to be shown beside session `shown`; null of a file. */
  async ask(service: Service, shown: string | null) {
    this.service = service;
    this.shown = shown;
    this.sessions = [];
    this.next = null;
    this.wanted = '';
    await this.updateComplete;
    this.dialog.showModal();
    await this.load();
  }

  get isOpen(): boolean {
    return this.hasUpdated && this.dialog.open;
  }

  override render() {
    const { sessions, next, problem, isLoading } = this;
    const wanted = this.wanted.toLowerCase();
    const found = sessions.filter((session) => nameOf(session).toLowerCase().includes(wanted));
    return html`<dialog aria-labelledby="compare-title">
      <header>
        <h2 id="compare-title">Compare with</h2>
        ${iconButton('close', 'Close', () => this.dialog.close())}
      </header>
      <input
        type="search"
        placeholder="Search sessions"
        aria-label="Search sessions"
        autofocus
        .value=${this.wanted}
        @input=${(event: Event) => (this.wanted = (event.target as HTMLInputElement).value)}
        @keydown=${(event: Event) => event.stopPropagation()}
      />
      <ul aria-label="Sessions">
        ${found.map(
          (session) =>
            html`<li>
              <button class="quiet" @click=${() => this.choose({ session: session.id })}>
                <span class="clip">${nameOf(session)}</span>
                <small class="figures fine"
                  >${count(session.points ?? 0)} points, ${count(session.frames.solved)} frames</small
                >
              </button>
            </li>`,
        )}
      </ul>
      ${
        problem !== null
          ? html`<p role="alert">${problem}</p>`
          : isLoading
            ? html`<p class="muted" role="status">Loading sessions…</p>`
            : found.length === 0
              ? html`<p class="muted" role="status">${wanted === '' ? 'No other sessions' : 'No matching sessions'}</p>`
              : nothing
      }
      <footer class="buttons">
        ${next !== null ? html`<button @click=${() => void this.load()}>Load more</button>` : nothing}
        <button @click=${() => pickFiles(([{ file }]) => this.choose({ file }), { accept: '.cager' })}>
          ${glyphs.file} Open file
        </button>
      </footer>
    </dialog>`;
  }

  private async load() {
    if (!this.service || this.isLoading) return;
    this.isLoading = true;
    this.problem = null;
    try {
      const { sessions, next } = await this.service.sessions(this.next);
      const others = sessions.filter(
        ({ id, state }) => id !== this.shown && state !== 'failed' && state !== 'preparing',
      );
      this.sessions = [...this.sessions, ...others];
      this.next = next;
    } catch (error) {
      const problem = problemBehind(error);
      // The page asks for a token then, which a modal dialog would cover.
      if (problem instanceof ServiceProblem && problem.status === 401) this.dialog.close();
      else this.problem = sentenceOf(problem);
    }
    this.isLoading = false;
  }

  private choose(detail: CompareChoice) {
    this.dialog.close();
    this.dispatchEvent(new CustomEvent('compare', { detail }));
  }
}
