import { html, nothing } from 'lit';
import type { StaticPart } from '../capture';
import type { Keeping } from './keptEdits';

/** What somebody who edits a capture has to know: whether the edits are kept, and what they do not change. */
export function editNotes(part: StaticPart, keeping: Keeping) {
  const isCoded = (part.report?.coding as { residual_step?: number } | undefined)?.residual_step !== undefined;
  return html`${
    keeping === 'kept'
      ? nothing
      : html`<p class="muted">
          ${
            keeping === 'large'
              ? 'These edits are too large to be kept in this browser'
              : keeping === 'elsewhere'
                ? 'Another tab keeps its edits of this capture, so these are not kept'
                : 'This browser does not keep edits'
          }:
          export them before you leave it.
        </p>`
  }
  ${
    part.system === 'green-free'
      ? html`<p class="muted">
          Normals of this cage are stored beside its vertices and stay as they were captured: the model follows a moved
          vertex, but does not turn or swell with the faces around it. Encode with
          <code>--coordinates green</code> for that.
        </p>`
      : nothing
  }
  ${
    isCoded
      ? html`<p class="muted">
          Fine detail cannot follow edits and is left out of an edited capture, here and in exports.
        </p>`
      : nothing
  }`;
}

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
