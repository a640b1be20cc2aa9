import { html, nothing } from 'lit';
import type { CageEdit, FrameRange } from './cageEdit';
import { iconButton } from '../style/parts';
import type { CageEditor } from './editor';
import { angleOf, type Motion, degrees, timesAs } from './motion';
import type { EditLayer, StaticPart } from '../capture';
import { nameOf } from './editLayers';
import type { EditModel } from './editModel';
import type { Keeping } from './keptEdits';

/** An edit in the list: whether it counts, its vertices and frames; of the one that is worked on, fields for its range. */
export function editRow(editor: CageEditor, edit: CageEdit) {
  const { model } = editor;
  const { id, motion, range, enabled } = edit;
  const name = nameOf(edit);
  const isActive = model.active?.id === id;
  const activate = () => model.activate(isActive ? null : id);
  return html`<li class=${isActive ? 'active' : nothing}>
    <div class="row">
      <input
        type="checkbox"
        aria-label=${`Enable edit of ${name}, frames ${range.first} to ${range.last}`}
        .checked=${enabled}
        @change=${() => model.setEnabled(id, !enabled)}
      />
      <button class="quiet name grow" aria-expanded=${isActive} @click=${activate}>
        <span>${name}<span class="muted">${amountOf(motion)}</span></span>
        <span class="muted figures">${framesText(range.first, range.last)}</span>
      </button>
      ${iconButton('trash', `Remove edit of ${name}`, () => model.remove(id), 'Remove')}
    </div>
    ${isActive ? rangeFields(editor, edit) : nothing}
  </li>`;
}

/** An edit that the file has, with this place among them. */
export function layerRow(model: EditModel, layer: EditLayer, place: number) {
  const { first, count, isOn } = layer;
  const name = layer.name || `Edit ${place + 1}`;
  const last = first + count - 1;
  return html`<li>
    <div class="row">
      <input
        type="checkbox"
        aria-label=${`Enable ${name} of the file, frames ${first} to ${last}`}
        .checked=${isOn}
        @change=${() => model.switchLayer(layer)}
      />
      <span class="name layer grow">
        <span class="clip">${name}<span class="muted"> · saved</span></span>
        <span class="muted figures">${framesText(first, last)}</span>
      </span>
      ${iconButton('trash', `Remove ${name} of the file`, () => model.removeLayer(layer), 'Remove')}
    </div>
  </li>`;
}

const framesText = (first: number, last: number) => (first === last ? String(first) : `${first}–${last}`);

/** How far an edit rotates or scales; nothing of one that moves. */
function amountOf(motion: Motion): string {
  if (motion.kind === 'rotate') return ` · ${degrees(angleOf(motion.rotation))}`;
  if (motion.kind === 'scale') return ` · ${timesAs(motion.factors)}`;
  return '';
}

function rangeFields({ model, player }: CageEditor, { id, range }: CageEdit) {
  const frames = player.capture.frames;
  const field = (key: keyof FrameRange, label: string) =>
    html`<label class="muted"
      >${label}
      <input
        type="number"
        class="figures"
        min="0"
        max=${frames - 1}
        .value=${String(range[key])}
        @change=${(event: Event) => {
          const input = event.target as HTMLInputElement;
          if (input.value !== '') model.setRange(id, { ...range, [key]: Number(input.value) }, frames);
          // What does not fit was put right, perhaps to what it was before.
          input.value = String(model.edits.find((other) => other.id === id)?.range[key] ?? range[key]);
        }}
    /></label>`;
  return html`<div class="range">
    ${field('first', 'First')} ${field('last', 'Last')} ${field('easeIn', 'Ease in')} ${field('easeOut', 'Ease out')}
  </div>`;
}

/** What somebody who edits a capture has to know: whether the edits are kept, and what they do not change. */
export function editNotes(part: StaticPart, keeping: Keeping) {
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
