import { LitElement, html, nothing } from 'lit';
import { customElement, query, state } from 'lit/decorators.js';
import { repeat } from 'lit/directives/repeat.js';
import { keepView, parseFragment } from '../routes';
import type { Session } from '../service/messages';
import { ServiceProblem, sentenceOf } from '../service/problem';
import { Service } from '../service/service';
import { pageToken } from '../service/token';
import { controls, pageLayout } from '../style/controls';
import { terms } from '../style/parts';
import { tokens } from '../style/tokens';
import { cardsStyle } from './cardsStyle';
import { download, type Format } from './download';
import {
  deleteDialog,
  renameDialog,
  isFiltering,
  matches,
  placeOf,
  viewOf,
  type StateFilter,
  filterBar,
  listHeader,
  listNotices,
  emptyList,
} from './listParts';
import { FigureLoader } from './figures';
import './recoveries';
import { nameOf, row, tableHead } from './row';
import { SessionList } from './sessionList';
import { sessionsStyle } from './sessionsStyle';
import './signIn';
import { forgetThumbnails } from './thumbnails';

const PAGE_ROWS = 25;

/**
 * The sessions of the service beside the page: newest first, kept up to date while the page is seen, to be searched, opened, downloaded and
 * deleted. Asks for a token where the service wants one.
 */
@customElement('cager-sessions')
export class Sessions extends LitElement {
  static override styles = [tokens, controls, pageLayout, sessionsStyle, cardsStyle];

  private readonly service = new Service();
  private readonly list = new SessionList(this.service);
  private readonly figures = new FigureLoader(this.service);

  @state() private text = '';
  @state() private states: StateFilter = 'all';
  @state() private page = 0;
  @state() private wantsToken = false;
  /** What is asked about which session. */
  @state() private asked: { readonly session: Session; readonly what: 'rename' | 'delete' } | null = null;
  @state() private isChanging = false;
  @state() private changeFailure = '';
  /** Why something that was asked for did not happen. */
  @state() private failure = '';
  @state() private said = '';
  @state() private downloads: ReadonlyMap<string, number> = new Map();
  @query('dialog') private dialog!: HTMLDialogElement;

  private clock: ReturnType<typeof setInterval> | undefined;
  private fetchingOlder = false;

  /** Shows what an address names. */
  goTo(view: URLSearchParams) {
    ({ text: this.text, state: this.states, page: this.page } = placeOf(view));
    this.keepView();
  }

  override connectedCallback() {
    super.connectedCallback();
    this.goTo(parseFragment(location.hash).view);
    this.list.addEventListener('change', this.changed);
    this.figures.addEventListener('change', this.changed);
    pageToken.addEventListener('wanted', this.tokenWanted);
    pageToken.addEventListener('change', this.tokenChanged);
    document.addEventListener('visibilitychange', this.visibilityChanged);
    // Ages and rates go on without news from the service.
    this.clock = setInterval(() => this.requestUpdate(), 5000);
    this.visibilityChanged();
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.list.removeEventListener('change', this.changed);
    this.figures.removeEventListener('change', this.changed);
    pageToken.removeEventListener('wanted', this.tokenWanted);
    pageToken.removeEventListener('change', this.tokenChanged);
    document.removeEventListener('visibilitychange', this.visibilityChanged);
    clearInterval(this.clock);
    this.list.stop();
  }

  override render() {
    if (this.wantsToken) return html`<div class="page"><cager-sign-in></cager-sign-in></div>`;
    const sessions = this.list.sessions;
    const isEmpty = this.list.loaded && sessions.length === 0;
    return html`
      <main class="page">
        ${listHeader(sessions, this.list.hasOlder)}
        ${listNotices(this.list.trouble, this.failure, {
          onRetry: () => this.list.refresh(),
          onClose: () => (this.failure = ''),
        })}
        ${isEmpty ? emptyList() : html`${this.filters()}${this.table(sessions)}`}
        <cager-recoveries></cager-recoveries>
        <details class="about">
          <summary>About CageR: cage, diagonal, L2 and L∞</summary>
          ${terms}
        </details>
        ${this.question()}
        <p class="visually-hidden" role="status">${this.said}</p>
      </main>
    `;
  }

  protected override updated() {
    const shown = this.shown(this.list.sessions).rows;
    const isOn = !document.hidden && this.isConnected && !this.wantsToken;
    this.figures.want(isOn ? shown : []);
    this.list.shown = new Set(shown.map(({ id }) => id));
  }

  private filters() {
    const filter = { text: this.text, state: this.states };
    return filterBar(filter, ({ text, state }) => this.filter(text, state));
  }

  private table(sessions: readonly Session[]) {
    if (!this.list.loaded) {
      return html`<div class="list card" aria-busy="true">
        ${[1, 2, 3].map(() => html`<div class="placeholder"></div>`)}
      </div>`;
    }
    const { rows, first, matching, isWhole } = this.shown(sessions);
    const now = Date.now() / 1000;
    return html`
      <div class="list card">
        <table role="table" aria-label="Sessions, newest first">
          ${tableHead}
          ${repeat(
            rows,
            (session) => session.id,
            (session) =>
              row({
                session,
                figures: this.figures.of(session.id),
                rate: this.list.rateOf(session.id),
                now,
                downloaded: this.downloads.get(session.id) ?? null,
                onDownload: (format) => void this.download(session, format),
                onRename: () => void this.ask(session, 'rename'),
                onRemove: () => void this.ask(session, 'delete'),
              }),
          )}
        </table>
        ${rows.length === 0 ? html`<p class="nothing muted">No matching sessions</p>` : nothing}
      </div>
      ${
        matching > rows.length || !isWhole
          ? html`<nav class="pager row muted" aria-label="Pages">
              <span class="figures">${first + 1}–${first + rows.length} of ${matching}${isWhole ? '' : '+'}</span>
              <button type="button" ?disabled=${first === 0} @click=${() => this.turn(-1)}>Newer</button>
              <button
                type="button"
                ?disabled=${isWhole && first + rows.length >= matching}
                @click=${() => this.turn(1)}
              >
                Older
              </button>
            </nav>`
          : nothing
      }
    `;
  }

  private question() {
    if (!this.asked) return nothing;
    const { session, what } = this.asked;
    const dialog = {
      isRunning: this.isChanging,
      failure: this.changeFailure,
      // The event comes late: the dialog may be another one by then, or open again.
      onClose: (event: Event) => {
        if (event.target === this.dialog && !this.dialog.open) this.asked = null;
      },
      onCancel: () => this.dialog.close(),
    };
    return what === 'delete'
      ? deleteDialog(session, dialog, () => void this.change(() => this.removeSession(session)))
      : renameDialog(session, dialog, (name) => void this.change(() => this.renameSession(session, name.trim())));
  }

  /** The rows of the present page; `matching` of the sessions here are those asked for, and `isWhole` says that there are no older ones. */
  private shown(sessions: readonly Session[]) {
    const filter = { text: this.text, state: this.states };
    const matching = sessions.filter((session) => matches(session, filter));
    const last = Math.max(0, Math.ceil(matching.length / PAGE_ROWS) - 1);
    const first = PAGE_ROWS * Math.min(this.page, last);
    const isWhole = !this.list.hasOlder;
    // Older pages may have more of what is asked for, or the page that an address names.
    const isShort = isFiltering(filter) ? matching.length < first + PAGE_ROWS : this.page > last;
    if (!isWhole && isShort) void this.fetchOlder();
    return { rows: matching.slice(first, first + PAGE_ROWS), first, matching: matching.length, isWhole };
  }

  private filter(text: string, states: StateFilter) {
    this.text = text;
    this.states = states;
    this.page = 0;
    this.keepView();
  }

  private keepView() {
    keepView(viewOf({ text: this.text, state: this.states, page: this.page }));
  }

  private async turn(pages: number) {
    const { first, rows, matching, isWhole } = this.shown(this.list.sessions);
    if (pages > 0 && !isWhole && first + rows.length >= matching) await this.fetchOlder();
    this.page = Math.max(0, first / PAGE_ROWS + pages);
    this.keepView();
    this.scrollTo({ top: 0 });
  }

  private async fetchOlder() {
    if (this.fetchingOlder) return;
    this.fetchingOlder = true;
    try {
      await this.list.older();
    } catch (error) {
      this.failure = sentenceOf(error);
    } finally {
      this.fetchingOlder = false;
      // What was rendered meanwhile may want still older ones.
      this.requestUpdate();
    }
  }

  private async download(session: Session, format: Format) {
    const note = (part: number | null) => {
      const downloads = new Map(this.downloads);
      if (part === null) downloads.delete(session.id);
      else downloads.set(session.id, part);
      this.downloads = downloads;
    };
    try {
      note(0);
      await download(this.service, session.id, nameOf(session), format, note);
      this.said = `Downloaded ${nameOf(session)}`;
    } catch (error) {
      this.failure = sentenceOf(error);
    } finally {
      note(null);
    }
  }

  private async ask(session: Session, what: 'rename' | 'delete') {
    this.changeFailure = '';
    this.asked = { session, what };
    await this.updateComplete;
    this.dialog.showModal();
    this.dialog.querySelector('input')?.select();
  }

  /** Does what was asked for; where that fails the question stays. */
  private async change(work: () => Promise<void>) {
    const { asked } = this;
    this.isChanging = true;
    try {
      await work();
      if (this.asked === asked) this.dialog.close();
    } catch (error) {
      if (this.asked === asked) this.changeFailure = sentenceOf(error);
      else this.failure = sentenceOf(error);
    } finally {
      this.isChanging = false;
    }
  }

  private async renameSession(session: Session, name: string) {
    await this.list.rename(session.id, name);
    this.said = `Renamed ${nameOf(session)}`;
  }

  private async removeSession(session: Session) {
    const ids = this.shown(this.list.sessions).rows.map(({ id }) => id);
    await this.list.remove(session.id);
    this.said = `Deleted ${nameOf(session)}`;
    this.asked = null;
    // The button that had the focus is gone; the row after it, or the last one, takes it.
    const at = ids.indexOf(session.id);
    const next = ids[at + 1] ?? ids[at - 1];
    await this.updateComplete;
    const selector = next ? `tbody[data-id="${CSS.escape(next)}"] a.name` : 'a.primary';
    this.renderRoot.querySelector<HTMLElement>(selector)?.focus();
  }

  private readonly changed = () => {
    const { trouble } = this.list;
    this.wantsToken = trouble?.problem instanceof ServiceProblem && trouble.problem.status === 401;
    this.requestUpdate();
  };

  private readonly tokenWanted = () => {
    this.wantsToken = true;
  };

  private readonly tokenChanged = () => {
    if (pageToken.token === null) forgetThumbnails();
    this.wantsToken = false;
    // What another token showed has other pages; before the first one, the page is that of the address.
    if (this.list.loaded) this.page = 0;
    this.keepView();
    this.figures.reset();
    this.list.reset();
  };

  private readonly visibilityChanged = () => {
    if (document.hidden) this.list.stop();
    else this.list.start();
    this.requestUpdate();
  };
}

declare global {
  interface HTMLElementTagNameMap {
    'cager-sessions': Sessions;
  }
}
