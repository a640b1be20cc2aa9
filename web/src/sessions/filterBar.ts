import { html } from 'lit';
import type { Filter, StateFilter } from './filter';
import { glyphs } from '../style/glyphs';

const STATES: readonly (readonly [StateFilter, string])[] = [
  ['all', 'All'],
  ['running', 'Running'],
  ['completed', 'Completed'],
  ['failed', 'Failed'],
];

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
      <div class="states segments" role="group" aria-label="State">
        ${STATES.map(
          ([state, word]) =>
            html`<button
              type="button"
              aria-pressed=${chosen === state ? 'true' : 'false'}
              @click=${() => onFilter({ text, state })}
            >
              ${word}
            </button>`,
        )}
      </div>
    </div>
  `;
}
