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

/** The product and the words that its pages use. */
export const terms = html`<p>
    CageR stores an animated mesh as the motion of a cage and plays it back by moving the mesh with the cage.
  </p>
  <dl class="terms">
    <dt>Cage</dt>
    <dd>A coarse mesh around the model. Moving its vertices deforms the model inside.</dd>
    <dt>Diagonal</dt>
    <dd>The diagonal of the box around the rest pose. Errors are given in percent of it.</dd>
    <dt>L2</dt>
    <dd>The root mean square of the distances between the original points and the decoded ones, in one frame.</dd>
    <dt>L∞</dt>
    <dd>The largest of these distances: the worst point.</dd>
  </dl>`;
