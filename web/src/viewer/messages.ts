import { html, nothing, type TemplateResult } from 'lit';
import type { Dropped } from '../files/classify';
import { pickFiles } from '../files/drop';
import { glyphs } from '../style/glyphs';
import { iconButton } from '../style/parts';

/** Loads the page anew, where a sentence says that this helps. */
function reloadButton(problem: string) {
  return problem.endsWith('Reload the page.')
    ? html`<button @click=${() => location.reload()}>Reload</button>`
    : nothing;
}

export function notice(problem: string, close: () => void): TemplateResult {
  return html`<div class="toast glass row" role="alert">
    <span>${problem}</span>
    ${reloadButton(problem)} ${iconButton('close', 'Dismiss', close)}
  </div>`;
}

/** Asks what is to be done with a container that was dropped on an open capture. Whoever renders it opens it as a modal dialog. */
export function dropQuestion(name: string, answer: (choice: 'instead' | 'beside' | null) => void): TemplateResult {
  return html`<dialog
    class="question"
    aria-labelledby="question-title"
    @close=${(event: Event) => {
      const { returnValue } = event.target as HTMLDialogElement;
      answer(returnValue === 'instead' || returnValue === 'beside' ? returnValue : null);
    }}
  >
    <form method="dialog">
      <h2 id="question-title">Open ${name}?</h2>
      <div class="buttons">
        <button class="primary" value="instead" autofocus>Replace current</button>
        <button value="beside">Open side by side</button>
        <button class="quiet" value="">Cancel</button>
      </div>
    </form>
  </dialog>`;
}

export function dropHint(isShowing: boolean): TemplateResult {
  return html`<div class="drop">
    ${isShowing ? 'Drop a capture to open or compare, original frames, or a report' : 'Drop a capture to play it'}
  </div>`;
}

export function progressBox(doing: string, fraction: number | null): TemplateResult {
  return html`<div class="progress glass" role="status">
    <div class="spread figures">
      <span>${doing}</span><span>${fraction === null ? '' : `${Math.round(100 * fraction)} %`}</span>
    </div>
    <progress aria-label=${doing} max="1" .value=${fraction ?? 0} ?hidden=${fraction === null}></progress>
  </div>`;
}

/** What is there while there is no capture: its name while it is opened, else why it cannot be shown, and how to choose one. */
export function emptyState(
  opening: string | null,
  failure: string | null,
  choose: (files: readonly Dropped[]) => void,
  upload: (() => void) | null,
): TemplateResult {
  if (opening !== null && failure === null) {
    return html`<div class="empty" role="status">
      <div class="lead"><slot name="lead"></slot></div>
      <p>Opening ${opening}</p>
    </div>`;
  }
  return html`<div class="empty">
    <div class="lead"><slot name="lead"></slot></div>
    ${glyphs.cage}
    <h1>${failure === null ? 'Drop a capture here' : upload ? 'No capture yet' : 'Could not open'}</h1>
    ${
      failure === null
        ? html`<p>A .cager file plays in this page and is not uploaded.</p>`
        : html`<p class="notice" role="alert">${failure}</p>
            ${reloadButton(failure)}`
    }
    ${upload ? html`<button class="primary" @click=${upload}>${glyphs.upload} Upload</button>` : nothing}
    <button class=${upload ? '' : 'primary'} @click=${() => pickFiles(choose, { accept: '.cager,.json' })}>
      ${glyphs.file} Choose file
    </button>
  </div>`;
}
