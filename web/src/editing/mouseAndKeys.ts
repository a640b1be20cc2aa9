import { html } from 'lit';

const KEYS = [
  ['Enter', 'choose the vertex in the middle'],
  ['Tab', 'the next vertex; with Shift the one before'],
  ['Alt ←', 'the vertex on the left; so in every direction'],
  ['Q R U', 'move, rotate, scale'],
  ['← ↑', 'do so; with Shift farther'],
  ['Page ↑', 'away or clockwise; Page ↓ back'],
  ['Esc', 'choose none; then done'],
] as const;

/** How a cage is edited with the mouse and with keys. */
export const mouseAndKeys = html`<details>
  <summary>Mouse and keys</summary>
  <p>
    Drag a vertex, an arrow, a square or a ring. Shift and a click add a vertex, Shift and a drag choose all in a box;
    Shift while a ring or an arrow is dragged goes by steps of 15° or a tenth. A click beside the cage chooses none.
  </p>
  <dl class="keys">
    ${KEYS.map(
      ([key, text]) =>
        html`<dt><kbd>${key}</kbd></dt>
          <dd>${text}</dd>`,
    )}
  </dl>
</details>`;
