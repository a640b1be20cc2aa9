import { html } from 'lit';

const KEYS = [
  ['Enter', 'Select the vertex in the centre'],
  ['Tab', 'Next vertex; Shift for the previous one'],
  ['Alt ←', 'Vertex to the left; likewise with every arrow'],
  ['Q R U', 'Move, rotate, scale'],
  ['← ↑', 'Apply the tool; Shift for larger steps'],
  ['Page ↑', 'Push away or turn clockwise; Page ↓ reverses'],
  ['Esc', 'Deselect, then close'],
] as const;

export const mouseAndKeys = html`<details>
  <summary>Mouse and keyboard</summary>
  <p>
    Drag a vertex, an arrow, a square or a ring. Shift-click adds a vertex, Shift-drag selects a box. Hold Shift while
    dragging a ring or a block to snap to 15° or 0.1. Click beside the cage to deselect.
  </p>
  <dl class="keys">
    ${KEYS.map(
      ([key, text]) =>
        html`<dt><kbd>${key}</kbd></dt>
          <dd>${text}</dd>`,
    )}
  </dl>
</details>`;
