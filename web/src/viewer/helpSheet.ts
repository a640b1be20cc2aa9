import { html } from 'lit';
import { iconButton, terms } from '../style/parts';
import { keyLabel, SHORTCUTS } from './shortcuts';

const GESTURES = [
  ['Orbit', 'Drag', 'One finger'],
  ['Pan', 'Right button or Shift and drag', 'Two fingers'],
  ['Zoom', 'Scroll', 'Pinch'],
  ['Frame all', 'Double-click', 'Double-tap'],
] as const;

export function helpSheet(close: () => void) {
  return html`<dialog
    class="sheet"
    aria-labelledby="help-title"
    @click=${(event: Event) => event.target === event.currentTarget && close()}
  >
    <header>
      <h2 id="help-title">CageR help</h2>
      ${iconButton('close', 'Close', close)}
    </header>
    ${terms}
    <h3 class="fine">Mouse and touch</h3>
    <table>
      ${GESTURES.map(
        ([what, mouse, touch]) =>
          html`<tr>
            <th scope="row">${what}</th>
            <td>${mouse}</td>
            <td>${touch}</td>
          </tr>`,
      )}
    </table>
    <h3 class="fine keyboard">Keyboard shortcuts</h3>
    <div class="columns keyboard">
      ${SHORTCUTS.map(
        ({ title, entries }) =>
          html`<section>
            <h3 class="fine">${title}</h3>
            <dl class="keys">
              ${entries.map(
                ({ action, label }) =>
                  html`<dt><kbd>${keyLabel(action)}</kbd></dt>
                    <dd>${label}</dd>`,
              )}
            </dl>
          </section>`,
      )}
    </div>
  </dialog>`;
}
