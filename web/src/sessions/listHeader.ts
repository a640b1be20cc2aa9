import { html, nothing } from 'lit';
import type { Session } from '../service/messages';
import { sentenceOf } from '../service/problem';
import { pageToken } from '../service/token';
import { currentJob } from '../upload/currentJob';
import { glyphs } from '../style/glyphs';
import { isUnfinished, type SessionList } from './sessionList';
import { counted } from '../text';

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
            <button type="button" class="quiet icon" aria-label="Close" @click=${onClose}>${glyphs.close}</button>
          </div>`
        : nothing
    }
  `;
}
