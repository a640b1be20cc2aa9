import { html, nothing } from 'lit';
import type { Session } from '../service/messages';
import { glyphs } from '../style/glyphs';
import { nameOf } from './row';
import { isUnfinished } from './sessionList';

export interface DeleteDialog {
  /** Whether the service is being asked. */
  readonly isRunning: boolean;
  /** Why it could not be deleted; empty while all is well. */
  readonly failure: string;
  readonly onClose: (event: Event) => void;
  readonly onKeep: () => void;
  readonly onDelete: () => void;
}

/** Asks whether a session is to be deleted. Whoever renders it opens it as a modal dialog. */
export function deleteDialog(session: Session, dialog: DeleteDialog) {
  const stops = isUnfinished(session) ? 'Encoding stops. ' : '';
  const what = session.state === 'completed' ? 'Its file and frames' : 'Its frames';
  return html`
    <dialog aria-labelledby="delete-title" aria-describedby="delete-what" @close=${dialog.onClose}>
      <h2 id="delete-title">Delete “${nameOf(session)}”?</h2>
      <p id="delete-what">${stops}${what} are permanently deleted.</p>
      ${
        dialog.failure
          ? html`<p class="problem" role="alert">${glyphs.alert}<span>${dialog.failure}</span></p>`
          : nothing
      }
      <div class="buttons">
        <button type="button" autofocus @click=${dialog.onKeep}>Cancel</button>
        <button type="button" class="danger" ?disabled=${dialog.isRunning} @click=${dialog.onDelete}>Delete</button>
      </div>
    </dialog>
  `;
}
