import { html, nothing } from 'lit';
import { glyphs } from '../style/glyphs';
import { retryNow } from '../service/backoff';
import type { Figures } from '../sessions/figures';
import { count, counted, percent, perSecond, ratio as times, size, span } from '../text';
import { sampledFrames } from './motionCage';
import type { Stage, UploadJob, Measured } from './uploadJob';
import { axisOf } from '../charts/axis';
import { plot, thinned, type Series } from '../charts/plot';

const STEPS: readonly (readonly [Stage, string])[] = [
  ['designing', 'Design cage'],
  ['creating', 'Upload meshes'],
  ['preparing', 'Prepare'],
  ['sending', 'Upload frames'],
  ['completing', 'Finish file'],
];

const TITLES: Readonly<Record<Stage, string>> = {
  designing: 'Designing the cage',
  creating: 'Uploading the rest pose',
  preparing: 'Preparing the cage',
  sending: 'Encoding',
  completing: 'Finishing the file',
  completed: 'Encoded',
  stopped: 'Stopped',
  failed: 'Upload failed',
};

export function jobView(job: UploadJob, furthest: Stage, discard: () => void, startOver: () => void) {
  const { session, plan, stage } = job;
  const total = plan.frames.frames;
  const name = job.request.options.name ?? 'the capture';
  const steps = STEPS.filter(([step]) => step !== 'designing' || job.request.design);
  const canWatch = session !== null && session.state !== 'preparing' && session.state !== 'failed';
  const isOver = !job.isActive;
  const at = steps.findIndex(([step]) => step === (job.isActive ? stage : furthest));
  return html`
    <section class="card" aria-labelledby="job-title">
      <h2 id="job-title" class=${stage === 'completed' ? 'good' : ''}>${TITLES[stage]}: ${name}</h2>
      <ol class="steps">
        ${steps.map(([, word], i) => {
          const isDone = stage === 'completed' || i < at;
          const isCurrent = job.isActive && i === at;
          return html`<li class=${isDone ? 'done' : ''} aria-current=${isCurrent ? 'step' : nothing}>
            <span class="mark">${isDone ? glyphs.check : i + 1}</span>${word}
          </li>`;
        })}
      </ol>
      ${
        stage === 'designing'
          ? html`<progress aria-label="Design of the cage" max="1" value=${job.design?.fraction ?? nothing}></progress>`
          : html`<progress aria-label="Frames encoded" max=${total} value=${job.done}></progress>`
      }
      <div class="figuresRow figures">
        ${stage === 'designing' ? designFacts(job) : html`<span><b>${count(job.done)}</b> of ${counted(total, 'frame')}</span>`}
        ${stage === 'sending' ? html`<span>${perSecond(job.framesPerSecond)}</span><span>${size(job.bytesPerSecond)}/s</span>` : nothing}
        ${stage === 'sending' && job.secondsLeft !== null ? html`<span>${span(job.secondsLeft)} left</span>` : nothing}
        ${containerFacts(job.figures)}
      </div>
      ${
        job.trouble
          ? html`<p class=${job.isActive ? 'note' : 'note bad'} role="alert">
              ${glyphs.alert}<span class="grow">${job.trouble}</span>
              ${job.isActive ? html`<button type="button" @click=${retryNow}>Retry now</button>` : nothing}
            </p>`
          : nothing
      }
      ${errorChart(job.measured, session?.coding !== undefined && !job.isMeasuredAsCoded)}
      <div class="buttons">
        ${
          canWatch
            ? html`<a
                class="button ${isOver && stage !== 'completed' ? '' : 'primary'}"
                href="#/session/${encodeURIComponent(session.id)}"
                >${glyphs.play} ${isOver ? 'Open in viewer' : 'Watch live'}</a
              >`
            : nothing
        }
        ${
          stage === 'designing' && job.design?.vertices
            ? html`<button type="button" @click=${() => job.takeBest()}>Use this cage</button>`
            : nothing
        }
        ${job.isActive ? html`<button type="button" @click=${() => job.stop()}>Stop</button>` : nothing}
        ${
          stage === 'stopped' || stage === 'failed'
            ? html`<button type="button" class="primary" @click=${() => void job.run()}>
                  ${job.isAnew ? 'Start again' : stage === 'stopped' ? 'Resume' : 'Try again'}
                </button>
                <button type="button" @click=${discard}>${session ? 'Delete upload' : 'Dismiss'}</button>`
            : nothing
        }
        ${stage === 'completed' ? html`<button type="button" @click=${startOver}>Upload another capture</button>` : nothing}
      </div>
      ${stage === 'sending' ? html`<p class="muted">You can watch while it uploads. The upload continues while this tab is open, and can be resumed later.</p>` : nothing}
    </section>
  `;
}

function designFacts({ design, plan }: UploadJob) {
  if (!design) {
    const sent = sampledFrames(plan.frames.frames, plan.frames.points).length;
    return html`<span>Uploading ${counted(sent, 'sample frame')}</span>`;
  }
  const { vertices, stage, state } = design;
  const error = design.error?.held_back;
  return html`
    ${state === 'queued' ? html`<span>Queued</span>` : nothing}
    ${vertices ? html`<span>cage of <b>${count(vertices)} vertices</b> so far</span>` : nothing}
    ${typeof error === 'number' ? html`<span>mean error <b>${percent(error, 2)}</b></span>` : nothing}
    ${stage ? html`<span>${stage}</span>` : nothing}
  `;
}

function containerFacts(figures: Figures | null) {
  const { bytes, ratio, meanL2 } = figures ?? { bytes: null, ratio: null, meanL2: null };
  if (bytes === null) return nothing;
  return html`
    <span>file of <b>${size(bytes)}</b></span>
    ${ratio === null ? nothing : html`<span><b>${times(ratio)}</b> smaller than the frames</span>`}
    ${meanL2 === null ? nothing : html`<span>mean error <b>${percent(meanL2, 2)}</b></span>`}
  `;
}

/** @param isPreliminary whether the errors are those before frames are compressed: how large they are says nothing about the file */
export function errorChart(measured: Measured, isPreliminary = false) {
  const top = measured.linf.reduce((most, value) => (value > most ? value : most), 0);
  if (top === 0) return html``;
  const series = (values: Float32Array, color: string): Series => ({
    label: '',
    color: `var(--cager-${color})`,
    mark: 'line',
    points: thinned(values, (frame) => (frame + 0.5) / values.length),
  });
  const lines = [series(measured.linf, 'cage'), series(measured.l2, 'accent')];
  const scale = isPreliminary
    ? 'before compression, which makes them smaller'
    : `worst point ${percent(top, 2)} of the diagonal`;
  return html`
    <figure class="errors">
      <figcaption class="row fine">
        <span class="key linf"></span>Worst point <span class="key"></span>RMS of all points
        <span class="scale figures">${scale}</span>
      </figcaption>
      <div class="area" role="img" aria-label="Errors of the frames: ${scale}">
        ${plot({ x: axisOf([0, 1], 0), y: axisOf([0, 1.05 * top], 0), series: lines })}
      </div>
    </figure>
  `;
}
