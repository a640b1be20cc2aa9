import { html, nothing } from 'lit';
import { unsolved } from '../service/messages';
import { ServiceProblem, problemBehind } from '../service/problem';
import type { Service } from '../service/service';
import { glyphs } from '../style/glyphs';
import { age, count, counted } from '../text';
import { type FileMark, type FileMarks, difference, shareNames } from './fileMarks';
import { type KeptUpload, unfinishedUploads } from './keptUpload';
import { readDesign, removeDesign } from './motionCage';

export interface Interrupted {
  readonly kept: KeptUpload;
  /** Frames that the service has. */
  readonly solved: number;
}

/** An upload that files seem to belong to, and why they do not. */
export interface Misfit {
  readonly of: Interrupted;
  readonly why: string;
}

/** The upload that these are the files of; else one that has files of the same names, and what is different. */
export function fittingOf(uploads: readonly Interrupted[], marks: FileMarks) {
  const why = (of: Interrupted) => difference(marks, of.kept.present.marks);
  const fitting = uploads.find((one) => why(one) === null) ?? null;
  const similar = uploads.find(({ kept }) => shareNames(marks, kept.present.marks));
  const misfit: Misfit | null = fitting || !similar ? null : { of: similar, why: why(similar) ?? '' };
  return { fitting, misfit };
}

/** The uploads to a service that can be gone on with; `onFreed` is called when there may be more of them. */
export async function interruptedUploads(service: Service, onFreed: () => void): Promise<Interrupted[]> {
  const found: Interrupted[] = [];
  for (const kept of await unfinishedUploads(service.address(''), onFreed)) {
    const { session, design, frames } = kept.present;
    if (session === null && design !== null && (await answerOf(readDesign(service, design))) === 'gone') continue;
    const present = session === null ? null : await answerOf(service.session(session));
    if (present === 'gone') continue;
    if (present?.state === 'completed' || present?.state === 'failed') {
      kept.forget();
      continue;
    }
    const missing = present ? unsolved(present.frames, frames).reduce((sum, [a, b]) => sum + b - a, 0) : frames;
    found.push({ kept, solved: frames - missing });
  }
  return found;
}

export async function deleteInterrupted(service: Service, { kept }: Interrupted) {
  const { session, design } = kept.present;
  if (session !== null) await service.remove(session);
  if (design !== null) await removeDesign(service, design);
  kept.forget();
}

/** A session or a design; `gone` where it was deleted or belongs to another token, null where the service does not answer now. */
async function answerOf<T>(asked: Promise<T>): Promise<T | 'gone' | null> {
  try {
    return await asked;
  } catch (error) {
    const problem = problemBehind(error);
    return problem instanceof ServiceProblem && problem.isGone ? 'gone' : null;
  }
}

/** What was broken off, and what to drop to go on. `why` says why the files that were dropped are others. */
export function interruptedCard(interrupted: Interrupted, why: string, onDelete: () => void) {
  const { present } = interrupted.kept;
  const { rest, cage, frames } = present.marks;
  const files = [rest, cage, frames].filter((mark): mark is FileMark => Boolean(mark));
  return html`
    <section class="card" aria-label="Interrupted upload">
      <h2>Upload of “${nameOf(interrupted)}” was interrupted</h2>
      <p>
        ${progressOf(interrupted)} Started ${age(present.begun / 1000, Date.now() / 1000)}. To resume, drop the same
        ${files.length === 1 && files[0].files === 1 ? 'file' : 'files'} here again:
        ${files.map((mark, k) => html`${k > 0 ? ', ' : ''}<b>${mark.name}</b>`)}.
      </p>
      ${why ? html`<p class="note bad" role="alert">${glyphs.alert}<span>${why}</span></p>` : nothing}
      <div class="buttons">
        <button type="button" @click=${onDelete}>${present.session ? 'Delete upload' : 'Dismiss'}</button>
      </div>
    </section>
  `;
}

export function goOnCard(interrupted: Interrupted, onGoOn: () => void, onAnew: () => void) {
  return html`
    <section class="card" aria-label="Resume upload">
      <h2>Resume “${nameOf(interrupted)}”?</h2>
      <p>${progressOf(interrupted)} Only the rest is sent.</p>
      <div class="buttons">
        <button type="button" class="primary" @click=${onGoOn}>${glyphs.upload} Resume</button>
        <button type="button" @click=${onAnew}>Start a new upload</button>
      </div>
    </section>
  `;
}

function progressOf({ kept, solved }: Interrupted): string {
  return `${count(solved)} of ${counted(kept.present.frames, 'frame')} uploaded.`;
}

function nameOf({ kept }: Interrupted): string {
  return kept.present.choices.name.trim() || (kept.present.marks.frames?.name ?? 'the capture');
}
