import type { Session } from '../service/messages';
import { html, nothing } from 'lit';
import { glyphs } from '../style/glyphs';
import { sentenceOf } from '../service/problem';
import { pageToken } from '../service/token';
import { currentJob } from '../upload/currentJob';
import { isUnfinished, type SessionList } from './sessionList';
import { counted, serviceAddress, SYSTEM_NAMES } from '../text';
import { nameOf } from './row';
import walk from './walk.svg';
import { iconButton, segments } from '../style/parts';

/** States as people ask for them: `running` is everything that is not over. */
export type StateFilter = 'all' | 'running' | 'completed' | 'failed';

export interface Filter {
  readonly text: string;
  readonly state: StateFilter;
}

/** Whether a session is one of those asked for: every word is in its name, its identifier, its state or its coordinates. */
export function matches(session: Session, filter: Filter): boolean {
  const isOver = session.state === 'completed' || session.state === 'failed';
  if (filter.state === 'running' ? isOver : filter.state !== 'all' && session.state !== filter.state) return false;
  const { name, id, state, coordinates } = session;
  const text = [name ?? '', id, state, coordinates, SYSTEM_NAMES[coordinates]].join(' ').toLowerCase();
  return filter.text
    .toLowerCase()
    .split(/\s+/)
    .every((word) => text.includes(word));
}

export function isFiltering(filter: Filter): boolean {
  return filter.state !== 'all' || filter.text.trim() !== '';
}

const STATES: readonly (readonly [StateFilter, string])[] = [
  ['all', 'All'],
  ['running', 'Running'],
  ['completed', 'Completed'],
  ['failed', 'Failed'],
];

/** What an address names: what is searched, and the page, counted from 0. */
export function placeOf(view: URLSearchParams): Filter & { readonly page: number } {
  const [state] = STATES.find(([state]) => state === view.get('state')) ?? STATES[0];
  const page = Math.max(1, Math.floor(Number(view.get('page')) || 1)) - 1;
  return { text: view.get('search') ?? '', state, page };
}

/** Writes what {@link placeOf} reads; what is as usual is left out. */
export function viewOf({ text, state, page }: ReturnType<typeof placeOf>): URLSearchParams {
  const view = new URLSearchParams();
  if (text !== '') view.set('search', text);
  if (state !== 'all') view.set('state', state);
  if (page > 0) view.set('page', String(page + 1));
  return view;
}

export function filterBar({ text, state: chosen }: Filter, onFilter: (filter: Filter) => void) {
  return html`
    <div class="bar">
      <div class="search">
        ${glyphs.search}
        <input
          type="search"
          aria-label="Search sessions by name, identifier or coordinates"
          placeholder="Search"
          .value=${text}
          @input=${(event: InputEvent) => onFilter({ text: (event.target as HTMLInputElement).value, state: chosen })}
        />
      </div>
      ${segments('State', STATES, chosen, (state) => onFilter({ text, state }))}
    </div>
  `;
}

/** How many sessions there are, and what else can be done than look at one. */
export function listHeader(sessions: readonly Session[], hasOlder: boolean) {
  const running = sessions.filter(isUnfinished).length;
  const failed = sessions.filter((session) => session.state === 'failed').length;
  const summary = [
    hasOlder ? `${sessions.length}+ sessions` : counted(sessions.length, 'session'),
    running > 0 ? `${running} in progress` : '',
    failed > 0 ? `${failed} failed` : '',
  ];
  const isUploading = (currentJob()?.stage ?? 'completed') !== 'completed';
  return html`
    <header>
      <span class="brand">${glyphs.cage} CageR</span>
      <h1>Sessions</h1>
      <span class="muted">${sessions.length > 0 ? summary.filter(Boolean).join(' · ') : nothing}</span>
      <span class="grow"></span>
      ${
        pageToken.token === null
          ? nothing
          : html`<button type="button" class="quiet" @click=${() => pageToken.clear()}>Sign out</button>`
      }
      <a class="button" href="#/file">${glyphs.file} Open file</a>
      <a class="button primary" href="#/upload"
        >${glyphs.upload} ${isUploading ? 'Back to upload' : 'Upload a capture'}</a
      >
    </header>
  `;
}

/** Why the list is not up to date, and why something that was asked for did not happen. */
export function listNotices(
  trouble: SessionList['trouble'],
  failure: string,
  { onRetry, onClose }: { readonly onRetry: () => void; readonly onClose: () => void },
) {
  return html`
    ${
      trouble
        ? html`<div class="notice" role="alert">
            ${glyphs.alert}
            <p class="grow">
              ${sentenceOf(trouble.problem)} ${trouble.retryAt === null ? '' : 'Retrying automatically.'}
            </p>
            <button type="button" @click=${onRetry}>Retry now</button>
          </div>`
        : nothing
    }
    ${
      failure
        ? html`<div class="notice" role="alert">
            ${glyphs.alert}
            <p class="grow">${failure}</p>
            ${iconButton('close', 'Close', onClose)}
          </div>`
        : nothing
    }
  `;
}

export interface Dialog {
  readonly isRunning: boolean;
  /** Why it could not be done; empty while all is well. */
  readonly failure: string;
  readonly onClose: (event: Event) => void;
  readonly onCancel: () => void;
}

/** Asks for another name of a session. Whoever renders it opens it as a modal dialog. */
export function renameDialog(session: Session, dialog: Dialog, onRename: (name: string) => void) {
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    onRename(new FormData(event.target as HTMLFormElement).get('name') as string);
  };
  return html`
    <dialog aria-labelledby="rename-title" @close=${dialog.onClose}>
      <form @submit=${submit}>
        <h2 id="rename-title">Rename “${nameOf(session)}”</h2>
        <input name="name" aria-label="Name" maxlength="200" autofocus .value=${session.name ?? ''} />
        ${failureOf(dialog)}
        <div class="buttons">
          <button type="button" @click=${dialog.onCancel}>Cancel</button>
          <button class="primary" ?disabled=${dialog.isRunning}>Rename</button>
        </div>
      </form>
    </dialog>
  `;
}

function failureOf({ failure }: Dialog) {
  return failure ? html`<p class="problem" role="alert">${glyphs.alert}<span>${failure}</span></p>` : nothing;
}

/** Asks whether a session is to be deleted. Whoever renders it opens it as a modal dialog. */
export function deleteDialog(session: Session, dialog: Dialog, onDelete: () => void) {
  const stops = isUnfinished(session) ? 'Encoding stops. ' : '';
  const what = session.state === 'completed' ? 'Its file and frames' : 'Its frames';
  return html`
    <dialog aria-labelledby="delete-title" aria-describedby="delete-what" @close=${dialog.onClose}>
      <h2 id="delete-title">Delete “${nameOf(session)}”?</h2>
      <p id="delete-what">${stops}${what} are permanently deleted.</p>
      ${failureOf(dialog)}
      <div class="buttons">
        <button type="button" autofocus @click=${dialog.onCancel}>Cancel</button>
        <button type="button" class="danger" ?disabled=${dialog.isRunning} @click=${onDelete}>Delete</button>
      </div>
    </dialog>
  `;
}

export function emptyList() {
  const command = `cager encode --server ${serviceAddress()} --rest rest.obj --frames frames.npy -o capture.cager`;
  const copy = (event: Event) => {
    const button = event.currentTarget as HTMLElement;
    void navigator.clipboard.writeText(command).then(() => button.setAttribute('aria-label', 'Copied'));
  };
  return html`
    <section class="first" aria-labelledby="first-title">
      <img src=${walk} width="1220" height="400" alt="Five frames of a walk, each inside its cage" />
      <div>
        <h2 id="first-title">No sessions yet</h2>
        <p>A session turns one animated mesh into a small capture that plays here. There are three ways to start.</p>
      </div>
      <ul class="ways">
        <li class="card">
          <div>
            <h3>Upload from this browser</h3>
            <p>Drop a rest pose and its frames; a cage is created if you have none.</p>
          </div>
          <a class="button primary" href="#/upload">${glyphs.upload} Upload</a>
        </li>
        <li class="card">
          <div>
            <h3>Encode from the command line</h3>
            <p>Frames go to this service, and the session appears here.</p>
          </div>
          <span></span>
          <div class="command row">
            <code class="grow">${command}</code>
            <button type="button" class="icon" aria-label="Copy command" title="Copy command" @click=${copy}>
              ${glyphs.copy}
            </button>
          </div>
        </li>
        <li class="card">
          <div>
            <h3>Open a file</h3>
            <p>A .cager file plays in this page and is not uploaded.</p>
          </div>
          <a class="button" href="#/file">${glyphs.file} Open file</a>
        </li>
      </ul>
    </section>
  `;
}
