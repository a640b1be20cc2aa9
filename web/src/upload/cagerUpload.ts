import { LitElement, html, nothing } from 'lit';
import { customElement, state } from 'lit/decorators.js';
import { listAddress } from '../routes';
import { ServiceProblem, problemBehind, sentenceOf } from '../service/problem';
import { Service } from '../service/service';
import { pageToken } from '../service/token';
import { glyphs } from '../style/glyphs';
import '../sessions/signIn';
import { plotStyle } from '../charts/plot';
import { controls, pageLayout } from '../style/controls';
import { tokens } from '../style/tokens';
import { captureName, jobOf, newUpload } from './beginning';
import { type Dropped, type Item, type Role, classify, reassigned } from '../files/classify';
import { currentJob, setCurrentJob } from './currentJob';
import { droppedFiles } from '../files/drop';
import { marksOf, withEarlierRoles } from './fileMarks';
import {
  type Interrupted,
  type Misfit,
  deleteInterrupted,
  fittingOf,
  goOnCard,
  interruptedCard,
  interruptedUploads,
} from './interrupted';
import { jobView } from './jobView';
import type { KeptUpload } from './keptUpload';
import { extensionOf } from '../files/meshes';
import { type Choices, DEFAULT_CHOICES, optionsForm } from './optionsForm';
import { type Plan, planOf } from './plan';
import type { Stage } from './uploadJob';
import { dropZone, itemRow, planSummary } from './uploadParts';
import { uploadStyle } from './uploadStyle';

/**
 * Takes files that are dropped on it, says what it takes them for, and has them encoded by the service beside the page. An upload goes on while the
 * element is not in the page.
 */
@customElement('cager-upload')
export class Upload extends LitElement {
  static override styles = [tokens, controls, pageLayout, plotStyle, uploadStyle];

  private readonly service = new Service();

  @state() private dropped: readonly Dropped[] = [];
  @state() private items: readonly Item[] = [];
  @state() private plan: Plan | null = null;
  /** Why there is no plan, or what could not be read. */
  @state() private finding = '';
  @state() private choices: Choices = DEFAULT_CHOICES;
  @state() private isOver = false;
  @state() private wantsToken = false;
  /** Uploads that were broken off. */
  @state() private interrupted: readonly Interrupted[] = [];
  /** The one whose files were dropped; else one whose files these seem to be, and why they are not. */
  @state() private fitting: Interrupted | null = null;
  @state() private misfit: Misfit | null = null;
  private furthest: Stage = 'creating';
  private planning = 0;
  private wasNamed = false;

  override connectedCallback() {
    super.connectedCallback();
    pageToken.addEventListener('wanted', this.tokenWanted);
    pageToken.addEventListener('change', this.tokenChanged);
    currentJob()?.addEventListener('change', this.jobChanged);
    // Asks for a token before somebody has chosen files in vain.
    void this.service.sessions().catch(() => undefined);
    void this.lookForInterrupted();
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    pageToken.removeEventListener('wanted', this.tokenWanted);
    pageToken.removeEventListener('change', this.tokenChanged);
    currentJob()?.removeEventListener('change', this.jobChanged);
  }

  override render() {
    if (this.wantsToken) return html`<div class="page"><cager-sign-in></cager-sign-in></div>`;
    const job = currentJob();
    return html`
      <main class="page" @dragover=${this.dragOver} @dragleave=${() => (this.isOver = false)} @drop=${this.drop}>
        <header>
          <a class="button back" href=${listAddress()} aria-label="All sessions" title="All sessions">${glyphs.back}</a>
          <h1>Upload a capture</h1>
        </header>
        ${job ? jobView(job, this.furthest, () => void this.discard(), this.startOver) : html`${this.interruptedCards()}${dropZone(this.isOver, this.items.length === 0, (files) => void this.take(files), this.startOver)}${this.chosen()}`}
      </main>
    `;
  }

  private interruptedCards() {
    if (this.fitting) return nothing;
    const { misfit } = this;
    return this.interrupted.map((one) =>
      interruptedCard(one, misfit?.of === one ? misfit.why : '', () => void this.deleteInterrupted(one)),
    );
  }

  private chosen() {
    if (this.items.length === 0) return this.note();
    const { fitting } = this;
    if (fitting) {
      return goOnCard(
        fitting,
        () => this.plan && this.run(this.plan, fitting.kept),
        () => (this.fitting = null),
      );
    }
    return html`
      <form class="card" @submit=${this.submit}>
        <h2>Files</h2>
        <ul class="items">
          ${this.items.map((item) => itemRow(item, (role) => this.reassign(item, role)))}
        </ul>
        ${this.note()} ${this.plan ? planSummary(this.plan, this.choices) : nothing}
        ${optionsForm(this.choices, Boolean(this.plan?.cage), (choices) => {
          this.wasNamed ||= choices.name !== this.choices.name;
          this.choices = choices;
        })}
        <div class="buttons">
          <button class="primary" type="submit" ?disabled=${!this.plan}>${glyphs.upload} Encode</button>
        </div>
      </form>
    `;
  }

  private note() {
    return this.finding
      ? html`<p class="note bad" role="alert">${glyphs.alert}<span>${this.finding}</span></p>`
      : nothing;
  }

  private async discard() {
    const job = currentJob();
    try {
      await job?.discard();
      this.putAway();
    } catch (error) {
      if (job) job.trouble = sentenceOf(error);
      this.requestUpdate();
    }
  }

  private readonly submit = (event: SubmitEvent) => {
    event.preventDefault();
    const { plan, choices, items } = this;
    if (plan) this.run(plan, newUpload(this.service, plan, choices, items));
  };

  private run(plan: Plan, kept: KeptUpload) {
    // Somebody may press twice.
    if (currentJob()) return;
    const job = jobOf(this.service, plan, kept);
    job.addEventListener('change', this.jobChanged);
    setCurrentJob(job);
    void job.run();
  }

  private async lookForInterrupted() {
    this.interrupted = await interruptedUploads(this.service, () => {
      if (this.isConnected) void this.lookForInterrupted();
    });
  }

  private async deleteInterrupted(interrupted: Interrupted) {
    try {
      await deleteInterrupted(this.service, interrupted);
      this.misfit = null;
      await this.lookForInterrupted();
    } catch (error) {
      this.misfit = { of: interrupted, why: sentenceOf(error) };
    }
  }

  private readonly startOver = () => {
    this.dropped = [];
    this.items = [];
    this.plan = null;
    this.finding = '';
    this.fitting = this.misfit = null;
    this.choices = DEFAULT_CHOICES;
    this.wasNamed = false;
    this.putAway();
  };

  private putAway() {
    currentJob()?.removeEventListener('change', this.jobChanged);
    setCurrentJob(null);
    this.requestUpdate();
    void this.lookForInterrupted();
  }

  private readonly dragOver = (event: DragEvent) => {
    if (currentJob() || !event.dataTransfer?.types.includes('Files')) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = 'copy';
    this.isOver = true;
  };

  private readonly drop = (event: DragEvent) => {
    this.isOver = false;
    if (currentJob() || !event.dataTransfer) return;
    // An encoded capture is for the page around this one, which plays it.
    if (event.dataTransfer.files.length === 1 && extensionOf(event.dataTransfer.files[0].name) === 'cager') return;
    event.preventDefault();
    void this.take(droppedFiles(event.dataTransfer));
  };

  /** Takes files beside those that were taken before. */
  async take(files: readonly Dropped[] | Promise<readonly Dropped[]>) {
    try {
      const taken = await files;
      const paths = new Set(taken.map(({ path }) => path));
      // A file that is dropped again replaces the one before.
      this.dropped = [...this.dropped.filter(({ path }) => !paths.has(path)), ...taken];
      this.items = classify(this.dropped);
      for (const { kept } of this.interrupted) this.items = withEarlierRoles(this.items, kept.present.marks);
      await this.makePlan();
    } catch (error) {
      this.finding = sentenceOf(error);
    }
  }

  private reassign(item: Item, role: Role) {
    this.items = reassigned(this.items, item, role);
    void this.makePlan();
  }

  private async makePlan() {
    this.planning += 1;
    const planning = this.planning;
    let [plan, finding]: [Plan | null, string] = [null, ''];
    let [fitting, misfit]: [Interrupted | null, Misfit | null] = [null, null];
    try {
      plan = await planOf(this.items);
      ({ fitting, misfit } = fittingOf(this.interrupted, marksOf(this.items)));
    } catch (error) {
      finding = sentenceOf(error);
    }
    // Reading large files takes a while; only the last plan counts.
    if (planning !== this.planning) return;
    this.plan = plan;
    this.finding = finding;
    this.fitting = fitting;
    this.misfit = misfit;
    if (plan && !this.wasNamed) this.choices = { ...this.choices, name: captureName(plan, this.dropped, this.items) };
  }

  private readonly jobChanged = () => {
    const job = currentJob();
    if (job?.isActive) this.furthest = job.stage;
    this.requestUpdate();
  };

  private readonly tokenWanted = () => {
    this.wantsToken = true;
  };

  private readonly tokenChanged = () => {
    this.wantsToken = false;
    const job = currentJob();
    // An upload that stopped for want of a token goes on with the new one.
    void this.lookForInterrupted();
    if (pageToken.token !== null && job?.stage === 'failed') void job.run();
    else void this.service.sessions().catch((error: unknown) => this.note401(error));
  };

  private note401(error: unknown) {
    const problem = problemBehind(error);
    if (!(problem instanceof ServiceProblem && problem.status === 401)) this.finding = sentenceOf(problem);
  }
}
