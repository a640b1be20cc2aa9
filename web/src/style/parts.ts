import { html, nothing } from 'lit';
import { glyphs, type GlyphName } from './glyphs';

/** A button that has a drawing alone; its label is shown to a pointer that rests on it. */
export function iconButton(name: GlyphName, label: string, act: () => void, title = label) {
  return html`<button type="button" class="quiet icon" title=${title} aria-label=${label} @click=${act}>
    ${glyphs[name]}
  </button>`;
}

/** Buttons of which the one that is chosen is pressed: what each stands for, its text, and its title where that says more. */
export function segments<T>(
  label: string,
  choices: readonly (readonly [value: T, text: string, title?: string])[],
  chosen: T,
  choose: (value: T) => void,
) {
  return html`<div class="segments" role="group" aria-label=${label}>
    ${choices.map(
      ([value, text, title]) =>
        html`<button
          type="button"
          title=${title ?? nothing}
          aria-pressed=${String(value === chosen)}
          @click=${() => choose(value)}
        >
          ${text}
        </button>`,
    )}
  </div>`;
}
