import { html, nothing } from 'lit';
import { glyphs } from '../style/glyphs';
import { iconButton } from '../style/parts';
import { count } from '../text';
import type { PartChoice } from './partChoice';
import type { Player } from './player';

/** A finger that rests so long asks for what a double click does. */
const LONG_PRESS_MILLISECONDS = 500;
/** More lines than this nobody reads. */
const MAX_LINES = 1000;

/** The parts of a capture, each with a switch. */
export function partsPanel(player: Player, choice: PartChoice, close: () => void) {
  const { parts } = choice;
  const frame = Math.floor(player.transport.position);
  return html`<aside class="panel glass parts" aria-label="Parts">
    <header class="spread">
      <h2>Parts</h2>
      ${iconButton('close', 'Close', close)}
    </header>
    <ul>
      ${parts.slice(0, MAX_LINES).map((_, part) => line(choice, part, frame))}
    </ul>
    ${parts.length > MAX_LINES ? html`<p class="muted">And ${count(parts.length - MAX_LINES)} more.</p>` : nothing}
    <button ?disabled=${choice.allOn} @click=${() => choice.showAll()}>Show all</button>
    <p class="fine muted">Double-click, or press and hold, to show only one.</p>
  </aside>`;
}

function line(choice: PartChoice, part: number, frame: number) {
  const { path, points } = choice.parts[part];
  const isOn = choice.isOn(part);
  const only = () => choice.showOnly(part);
  return html`<li
    class="row ${isOn ? '' : 'off'}"
    title=${path}
    @dblclick=${only}
    @pointerdown=${(event: PointerEvent) => press(event, only)}
  >
    <label
      class="row grow"
      @click=${(event: MouseEvent) => {
        // The second click of a double click is for that.
        if (event.detail > 1) event.preventDefault();
      }}
    >
      <input type="checkbox" class="visually-hidden" .checked=${isOn} @change=${() => choice.toggle(part)} />
      ${glyphs[isOn ? 'eye' : 'eyeOff']}
      <span class="grow clip">${nameOf(path, part)}</span>
    </label>
    ${choice.isThere(part, frame) ? nothing : html`<span class="fine muted">not in this frame</span>`}
    <span class="fine muted figures">${count(points)}</span>
  </li>`;
}

/** The last of the names of a path. */
function nameOf(path: string, part: number): string {
  return path.slice(path.lastIndexOf('/') + 1) || `Part ${part + 1}`;
}

/** Acts when a finger has rested; its click then does nothing. */
function press({ pointerType, currentTarget }: PointerEvent, act: () => void) {
  if (pointerType === 'mouse') return;
  const line = currentTarget as HTMLElement;
  const stop = new AbortController();
  const timer = setTimeout(() => {
    stop.abort();
    line.addEventListener('click', (event) => event.preventDefault(), { capture: true, once: true });
    act();
  }, LONG_PRESS_MILLISECONDS);
  const cancel = () => {
    clearTimeout(timer);
    stop.abort();
  };
  for (const type of ['pointerup', 'pointercancel', 'pointerleave', 'pointermove'])
    line.addEventListener(type, cancel, { signal: stop.signal });
}
