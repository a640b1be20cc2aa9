import { LitElement, html, nothing } from 'lit';
import { customElement, state } from 'lit/decorators.js';
import { ServiceProblem, problemBehind, sentenceOf } from '../service/problem';
import { Service } from '../service/service';
import { pageToken } from '../service/token';
import * as glyphs from '../sessions/glyphs';
import '../sessions/signIn';
import { counted, size } from '../sessions/text';
import { controls, tokens } from '../style/tokens';
import { type Dropped, type Item, type Role, classify, reassigned } from './classify';
import { currentJob, setCurrentJob } from './currentJob';
import { droppedFiles, pickedFiles } from './drop';
import { type JobActions, jobView } from './jobView';
import { extensionOf } from './meshes';
import { type Choices, DEFAULT_CHOICES, optionsForm, optionsOf, sendsHandles } from './optionsForm';
import { type Plan, planOf } from './plan';
import { type Stage, UploadJob } from './uploadJob';
import { uploadStyle } from './uploadStyle';

const ROLE_WORDS: Readonly<Record<Role, string>> = {
  rest: 'Rest pose',
  cage: 'Cage',
  frames: 'Frames',
  unused: 'Not used',
};

/**
 * Takes files that are dropped on it, says what it takes them for, and has them encoded by the service beside the page. An upload goes on while the
 * element is not in the page.
 */
@customElement('cager-upload')
export class Upload extends LitElement {
  static override styles = [tokens, controls, uploadStyle];

  readonly #service = new Service();

  @state() private dropped: readonly Dropped[] = [];
  @state() private items: readonly Item[] = [];
  @state() private plan: Plan | null = null;
  /** Why there is no plan, or what could not be read. */
  @state() private finding = '';
  @state() private choices: Choices = DEFAULT_CHOICES;
  @state() private isOver = false;
  @state() private wantsToken = false;
  #furthest: Stage = 'creating';
  #planning = 0;
  #wasNamed = false;

  override connectedCallback(): void {
    super.connectedCallback();
    pageToken.addEventListener('wanted', this.#tokenWanted);
    pageToken.addEventListener('change', this.#tokenChanged);
    currentJob()?.addEventListener('change', this.#jobChanged);
    // Asks for a token before somebody has chosen files in vain.
    void this.#service.sessions().catch(() => undefined);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    pageToken.removeEventListener('wanted', this.#tokenWanted);
    pageToken.removeEventListener('change', this.#tokenChanged);
    currentJob()?.removeEventListener('change', this.#jobChanged);
  }

  override render() {
    if (this.wantsToken) return html`<div class="page"><cager-sign-in></cager-sign-in></div>`;
    const job = currentJob();
    return html`
      <main class="page" @dragover=${this.#dragOver} @dragleave=${() => (this.isOver = false)} @drop=${this.#drop}>
        <header>
          <a class="button back" href="#/" aria-label="All sessions" title="All sessions">${glyphs.back}</a>
          <h1>Upload a capture</h1>
        </header>
        ${job ? jobView(job, this.#furthest, this.#actions) : html`${this.#zone()}${this.#chosen()}`}
      </main>
    `;
  }

  #zone() {
    const isFirst = this.items.length === 0;
    return html`
      <div class="zone ${this.isOver ? 'over' : ''} ${isFirst ? '' : 'small'}">
        ${
          isFirst
            ? html`${glyphs.upload}
                <h2>Drop a rest pose, its frames and a cage here</h2>
                <p class="muted">All at once or one after another. Nothing is sent before you start it.</p>`
            : nothing
        }
        <div class="buttons">
          <button type="button" class=${isFirst ? 'primary' : ''} @click=${() => this.#pick(false)}>
            ${isFirst ? 'Choose files' : 'Add files'}
          </button>
          <button type="button" @click=${() => this.#pick(true)}>
            ${isFirst ? 'Choose a folder' : 'Add a folder'}
          </button>
          ${isFirst ? nothing : html`<button type="button" class="quiet" @click=${this.#startOver}>Start over</button>`}
        </div>
      </div>
      ${
        isFirst
          ? html`<ul class="kinds">
              <li><b>Rest pose</b><span>The mesh that moves: .obj, .ply, .off, .stl or .glb</span></li>
              <li><b>Frames</b><span>.npy (frames × points × 3), .pc2, or a folder with one .obj per frame</span></li>
              <li>
                <b>Cage, if you have one</b
                ><span>A coarse closed mesh around the rest pose; otherwise one is made</span>
              </li>
            </ul>`
          : nothing
      }
    `;
  }

  #chosen() {
    if (this.items.length === 0) return this.#note();
    return html`
      <form class="card" @submit=${this.#submit}>
        <h2>What these files are</h2>
        <ul class="items">
          ${this.items.map((item) => this.#item(item))}
        </ul>
        ${this.#note()} ${this.#summary()}
        ${optionsForm(this.choices, Boolean(this.plan?.cage), (choices) => {
          this.#wasNamed ||= choices.name !== this.choices.name;
          this.choices = choices;
        })}
        <div class="buttons">
          <button class="primary" type="submit" ?disabled=${!this.plan}>${glyphs.upload} Encode</button>
        </div>
      </form>
    `;
  }

  #item(item: Item) {
    const bytes = item.files.reduce((sum, file) => sum + file.size, 0);
    return html`
      <li>
        <span class="title ${item.role === 'unused' ? 'unused' : ''}" title=${item.name}>${item.name}</span>
        <span class="muted figures">${size(bytes)}</span>
        ${
          item.choices.length > 1
            ? html`<select
                aria-label="What ${item.name} is"
                .value=${item.role}
                @change=${(event: Event) => this.#reassign(item, (event.target as HTMLSelectElement).value as Role)}
              >
                ${item.choices.map((role) => html`<option value=${role} ?selected=${role === item.role}>${ROLE_WORDS[role]}</option>`)}
              </select>`
            : html`<span class="muted">${ROLE_WORDS[item.role]}</span>`
        }
        ${item.remark ? html`<span class="remark">${item.remark}</span>` : nothing}
      </li>
    `;
  }

  #note() {
    return this.finding
      ? html`<p class="note bad" role="alert">${glyphs.alert}<span>${this.finding}</span></p>`
      : nothing;
  }

  #summary() {
    if (!this.plan) return nothing;
    const { frames, remarks } = this.plan;
    const bytes = 12 * frames.frames * frames.points;
    const isAll = this.choices.accuracy !== 'cages' || !sendsHandles(this.choices, bytes);
    const sent = isAll
      ? 'They are sent whole.'
      : 'Only what the solver reads of them is sent; errors are not measured.';
    const sentence = `${counted(frames.frames, 'frame')} of ${counted(frames.points, 'point')}, ${size(bytes)} in single precision. ${sent}`;
    return html`<div class="note">
      ${glyphs.file}
      <p>${[sentence, ...remarks].join(' ')}</p>
    </div>`;
  }

  readonly #actions: JobActions = {
    stop: () => currentJob()?.stop(),
    goOn: () => void currentJob()?.run(),
    discard: () => void this.#discard(),
    another: () => this.#startOver(),
  };

  async #discard(): Promise<void> {
    const job = currentJob();
    try {
      await job?.discard();
      this.#putAway();
    } catch (error) {
      if (job) job.trouble = sentenceOf(error);
      this.requestUpdate();
    }
  }

  #submit = (event: SubmitEvent): void => {
    event.preventDefault();
    if (!this.plan) return;
    const { frames, cage } = this.plan;
    const options = optionsOf(this.choices, frames.frames, cage !== null);
    const handles = sendsHandles(this.choices, 12 * frames.frames * frames.points);
    const job = new UploadJob(this.#service, this.plan, options, handles);
    job.addEventListener('change', this.#jobChanged);
    setCurrentJob(job);
    void job.run();
  };

  #startOver = (): void => {
    this.dropped = [];
    this.items = [];
    this.plan = null;
    this.finding = '';
    this.choices = DEFAULT_CHOICES;
    this.#wasNamed = false;
    this.#putAway();
  };

  #putAway(): void {
    currentJob()?.removeEventListener('change', this.#jobChanged);
    setCurrentJob(null);
    this.requestUpdate();
  }

  #pick(folder: boolean): void {
    const input = document.createElement('input');
    input.type = 'file';
    input.multiple = true;
    input.webkitdirectory = folder;
    input.addEventListener('change', () => void this.#take(Promise.resolve(pickedFiles(input.files!))));
    input.click();
  }

  #dragOver = (event: DragEvent): void => {
    if (currentJob() || !event.dataTransfer?.types.includes('Files')) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = 'copy';
    this.isOver = true;
  };

  #drop = (event: DragEvent): void => {
    this.isOver = false;
    if (currentJob() || !event.dataTransfer) return;
    // An encoded capture is for the page around this one, which plays it.
    if (event.dataTransfer.files.length === 1 && extensionOf(event.dataTransfer.files[0].name) === 'cager') return;
    event.preventDefault();
    void this.#take(droppedFiles(event.dataTransfer));
  };

  async #take(files: Promise<Dropped[]>): Promise<void> {
    try {
      const taken = await files;
      const paths = new Set(taken.map(({ path }) => path));
      // A file that is dropped again replaces the one before.
      this.dropped = [...this.dropped.filter(({ path }) => !paths.has(path)), ...taken];
      this.items = classify(this.dropped);
      await this.#makePlan();
    } catch (error) {
      this.finding = sentenceOf(error);
    }
  }

  #reassign(item: Item, role: Role): void {
    this.items = reassigned(this.items, item, role);
    void this.#makePlan();
  }

  async #makePlan(): Promise<void> {
    this.#planning += 1;
    const planning = this.#planning;
    let [plan, finding]: [Plan | null, string] = [null, ''];
    try {
      plan = await planOf(this.items);
    } catch (error) {
      finding = sentenceOf(error);
    }
    // Reading large files takes a while; only the last plan counts.
    if (planning !== this.#planning) return;
    this.plan = plan;
    this.finding = finding;
    if (plan && !this.#wasNamed) this.choices = { ...this.choices, name: this.#nameOf(plan) };
  }

  /** The folder that was dropped, or the file of the frames, says best what it is. */
  #nameOf(plan: Plan): string {
    const path = this.dropped.find(({ path }) => path.includes('/'))?.path;
    const frames = this.items.find((item) => item.role === 'frames')?.files[0];
    return path?.split('/')[0] ?? (frames ?? plan.rest).name.replace(/\.[^.]*$/, '');
  }

  #jobChanged = (): void => {
    const job = currentJob();
    if (job?.isActive) this.#furthest = job.stage;
    this.requestUpdate();
  };

  #tokenWanted = (): void => {
    this.wantsToken = true;
  };

  #tokenChanged = (): void => {
    this.wantsToken = false;
    const job = currentJob();
    // An upload that stopped for want of a token goes on with the new one.
    if (pageToken.token !== null && job?.stage === 'failed') void job.run();
    else void this.#service.sessions().catch((error: unknown) => this.#note401(error));
  };

  #note401(error: unknown): void {
    const problem = problemBehind(error);
    if (!(problem instanceof ServiceProblem && problem.status === 401)) this.finding = sentenceOf(problem);
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'cager-upload': Upload;
  }
}
