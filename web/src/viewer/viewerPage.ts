import { css, html, LitElement, nothing, type PropertyValues } from 'lit';
import { customElement, property, query, state } from 'lit/decorators.js';
import type { Capture } from '../capture';
import { listAddress } from '../routes';
import { problemBehind, ServiceProblem } from '../service/problem';
import { Service } from '../service/service';
import { pageToken } from '../service/token';
import '../sessions/signIn';
import { keepThumbnail } from '../sessions/thumbnails';
import { controls } from '../style/controls';
import { glyphs } from '../style/glyphs';
import type { Dropped } from '../files/classify';
import './cagerViewer';
import type { CagerViewer } from './cagerViewer';
import './compareDialog';
import type { CompareChoice, CompareDialog } from './compareDialog';
import { jobCapture, type JobKind, sessionCapture } from './serviceCapture';

/** When a picture is taken for the list after the model can be seen: frames come then. */
const THUMBNAIL_MILLISECONDS = 1000;

/** The page of one capture: a session or a recovery of the service, or a file. */
@customElement('cager-viewer-page')
export class ViewerPage extends LitElement {
  static override styles = [
    controls,
    css`
      :host {
        display: block;
        height: 100dvh;
      }
      main {
        height: 100%;
      }
      .back {
        background: var(--cager-glass);
        box-shadow: var(--cager-shadow);
      }
      .sign-in {
        position: fixed;
        inset: 0;
        z-index: 1;
        overflow: auto;
        padding: var(--cager-space-4);
        background: color-mix(in srgb, var(--cager-background) 70%, transparent);
      }
      .message {
        display: grid;
        place-content: center;
        justify-items: center;
        gap: var(--cager-space-4);
        padding: var(--cager-space-5);
        text-align: center;
      }
      .message p {
        max-width: 36em;
        text-wrap: balance;
      }
    `,
  ];

  /** The session, recovery or transfer to show; null for a file. */
  @property() job: string | null = null;
  @property() kind: 'session' | JobKind = 'session';
  @property({ attribute: false }) files: readonly Dropped[] = [];
  @property() view = '';
  @state() private capture: Capture | null = null;
  /** A session that is shown beside the capture. */
  @state() private beside: Capture | null = null;
  @state() private waiting = '';
  @state() private failure: Error | null = null;
  @state() private wantsToken = false;
  @query('cager-viewer') private readonly viewer!: CagerViewer | null;
  @query('cager-compare-dialog') private readonly dialog!: CompareDialog | null;
  private readonly service = new Service();
  private opening = new AbortController();
  private openingBeside = new AbortController();
  /** The session that the link names to be shown beside the capture. */
  private besideId: string | null = null;
  /** The view as the viewer told it last. */
  private shownView = '';
  private readonly retry = () => void this.openSession();
  private readonly tokenWanted = () => (this.wantsToken = true);
  private readonly passKey = (event: KeyboardEvent) => {
    if (!this.wantsToken && this.dialog?.isOpen !== true) this.viewer?.pressKey(event);
  };

  goTo(view: string) {
    this.followBeside(view);
    if (this.viewer) this.viewer.goTo(view);
    else this.view = view;
  }

  override connectedCallback() {
    super.connectedCallback();
    pageToken.addEventListener('change', this.tokenChanged);
    pageToken.addEventListener('wanted', this.tokenWanted);
    document.addEventListener('keydown', this.passKey);
    void this.openSession();
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    pageToken.removeEventListener('change', this.tokenChanged);
    pageToken.removeEventListener('wanted', this.tokenWanted);
    document.removeEventListener('keydown', this.passKey);
    this.opening.abort();
    this.openingBeside.abort();
    this.capture?.close();
    this.beside?.close();
  }

  protected override firstUpdated(changed: PropertyValues) {
    this.followBeside(this.view);
    if (changed.has('files')) void this.viewer?.openFiles(this.files);
  }

  override render() {
    if (this.job !== null && !this.capture)
      return this.wantsToken ? html`<main><cager-sign-in></cager-sign-in></main>` : this.message();
    return html`<main>
      <cager-viewer
        autoplay
        uploads
        ?linkable=${this.job !== null}
        ?inert=${this.wantsToken}
        .capture=${this.capture}
        .beside=${this.beside}
        .view=${this.view}
        @signin=${this.tokenWanted}
        @viewchange=${this.tellView}
        @ready=${this.whenReady}
        @besidewanted=${this.askBeside}
        @besideclosed=${() => this.setBeside(null)}
      >
        <a class="button back" slot="lead" href=${listAddress()} aria-label="All sessions" title="All sessions">
          ${glyphs.back}
        </a>
      </cager-viewer>
      <cager-compare-dialog @compare=${this.compare}></cager-compare-dialog>
      ${
        this.wantsToken
          ? html`<div class="sign-in" role="dialog" aria-modal="true" aria-label="Sign in">
              <cager-sign-in></cager-sign-in>
            </div>`
          : nothing
      }
    </main>`;
  }

  private message() {
    const isGone = this.failure instanceof ServiceProblem && this.failure.isGone;
    return html`<main class="message">
      ${
        this.failure === null
          ? html`<p role="status">${this.waiting || `Opening ${this.kind}`}</p>`
          : html`<p role="alert">${this.failure.message}</p>`
      }
      ${isGone ? nothing : html`<button class="primary" ?hidden=${this.failure === null} @click=${this.retry}>Try again</button>`}
      <a class=${isGone ? 'button primary' : ''} href=${listAddress()}>All sessions</a>
    </main>`;
  }

  /** A capture that is open stays: a running session is followed on with the new token, a finished one plays on when somebody asks. */
  private readonly tokenChanged = () => {
    this.wantsToken = false;
    if (!this.capture) void this.openSession();
    else this.viewer?.report(null);
    if (this.besideId !== null && !this.beside) void this.openBeside(this.besideId);
  };

  /** Tells the view with the session beside, for links. */
  private readonly tellView = (event: CustomEvent<string>) => {
    event.stopPropagation();
    this.shownView = event.detail;
    this.tellLink();
  };

  private readonly whenReady = () => {
    if (this.viewer) document.title = `${this.viewer.heading} – CageR`;
    this.keepThumbnail();
  };

  /** Keeps a picture of the session for the list, some time after the model can be seen. */
  private keepThumbnail() {
    const { capture, viewer } = this;
    setTimeout(() => {
      const session = capture && capture === this.capture ? capture.session : undefined;
      if (session !== undefined && viewer?.player) keepThumbnail(session, viewer.player.drawn());
    }, THUMBNAIL_MILLISECONDS);
  }

  private tellLink() {
    const view = new URLSearchParams(this.shownView);
    view.delete('beside');
    if (this.besideId !== null) view.set('beside', this.besideId);
    const detail = view.toString().replaceAll('%2C', ',');
    this.dispatchEvent(new CustomEvent('viewchange', { detail, bubbles: true, composed: true }));
  }

  private readonly askBeside = (event: Event) => {
    event.preventDefault();
    void this.dialog?.ask(this.service, this.job);
  };

  private readonly compare = (event: CustomEvent<CompareChoice>) => {
    const { detail } = event;
    if ('session' in detail) this.setBeside(detail.session);
    else {
      this.setBeside(null);
      void this.viewer?.openBeside(detail.file);
    }
  };

  /** Shows the session that a view names beside the capture; one that names none leaves a file there. */
  private followBeside(view: string) {
    this.shownView = view;
    const wanted = new URLSearchParams(view).get('beside');
    if (wanted !== this.besideId) this.setBeside(wanted);
  }

  private setBeside(id: string | null) {
    this.openingBeside.abort();
    this.besideId = id;
    this.beside?.close();
    this.beside = null;
    this.tellLink();
    if (id !== null) void this.openBeside(id);
  }

  private async openBeside(id: string) {
    this.openingBeside.abort();
    this.openingBeside = new AbortController();
    const { signal } = this.openingBeside;
    try {
      const capture = await sessionCapture(id, { service: this.service, signal });
      if (signal.aborted) capture.close();
      else this.beside = capture;
    } catch (error) {
      if (signal.aborted) return;
      const problem = problemBehind(error);
      if (problem instanceof ServiceProblem && problem.status === 401) this.wantsToken = true;
      else {
        this.besideId = null;
        this.tellLink();
        this.viewer?.report(`Could not open the second session: ${problem.message}`);
      }
    }
  }

  private async openSession() {
    const { job, service } = this;
    if (job === null) return;
    this.opening.abort();
    this.opening = new AbortController();
    const { signal } = this.opening;
    this.failure = null;
    this.wantsToken = false;
    try {
      const onWaiting = (sentence: string) => (this.waiting = sentence);
      const options = { service, signal, onWaiting };
      const { kind } = this;
      const capture = await (kind === 'session' ? sessionCapture(job, options) : jobCapture(kind, job, options));
      if (signal.aborted) {
        capture.close();
        return;
      }
      this.capture?.close();
      this.capture = capture;
    } catch (error) {
      if (signal.aborted) return;
      const problem = problemBehind(error);
      this.wantsToken = problem instanceof ServiceProblem && problem.status === 401;
      this.failure = problem;
    }
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'cager-viewer-page': ViewerPage;
  }
}
