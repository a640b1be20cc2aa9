import { html, nothing } from 'lit';
import type { CageEdit, FrameRange } from './cageEdit';
import { iconButton } from '../style/parts';
import type { CageEditor } from './editor';
import { angleOf, type Motion, degrees, timesAs } from './motion';
import type { EditLayer, StaticPart } from '../capture';
import { nameOf } from './editLayers';
import type { Keeping } from './keptEdits';
import { frameText, placeOf, rangeText } from '../viewer/frameNumbers';

/** An edit in the list: whether it counts, its vertices and frames; of the one that is worked on, fields for its range. */
export function editRow(editor: CageEditor, edit: CageEdit) {
  const { model, player } = editor;
  const { numbers } = player.transport;
  const { id, motion, range, enabled } = edit;
  const name = nameOf(edit);
  const isActive = model.active?.id === id;
  const activate = () => model.activate(isActive ? null : id);
  return html`<li class=${isActive ? 'active' : nothing}>
    <div class="row">
      <input
        type="checkbox"
        aria-label=${`Enable edit of ${name}, frames ${frameText(numbers, range.first)} to ${frameText(numbers, range.last)}`}
        .checked=${enabled}
        @change=${() => model.setEnabled(id, !enabled)}
      />
      <button class="quiet name grow" aria-expanded=${isActive} @click=${activate}>
        <span>${name}<span class="muted">${amountOf(motion)}</span></span>
        <span class="muted figures">${rangeText(numbers, range.first, range.last)}</span>
      </button>
      ${iconButton('trash', `Remove edit of ${name}`, () => model.remove(id), 'Remove')}
    </div>
    ${isActive ? rangeFields(editor, edit) : nothing}
  </li>`;
}

/** An edit that the file has, with this place among them. */
export function layerRow({ model, player }: CageEditor, layer: EditLayer, place: number) {
  const { numbers } = player.transport;
  const { first, count, isOn } = layer;
  const name = layer.name || `Edit ${place + 1}`;
  const last = first + count - 1;
  return html`<li>
    <div class="row">
      <input
        type="checkbox"
        aria-label=${`Enable ${name} of the file, frames ${frameText(numbers, first)} to ${frameText(numbers, last)}`}
        .checked=${isOn}
        @change=${() => model.switchLayer(layer)}
      />
      <span class="name layer grow">
        <span class="clip" title=${name}>${name}</span><span class="muted">saved</span>
        <span class="muted figures">${rangeText(numbers, first, last)}</span>
      </span>
      ${iconButton('trash', `Remove ${name} of the file`, () => model.removeLayer(layer), 'Remove')}
    </div>
  </li>`;
}

/** How far an edit rotates or scales; nothing of one that moves. */
function amountOf(motion: Motion): string {
  if (motion.kind === 'rotate') return ` · ${degrees(angleOf(motion.rotation))}`;
  if (motion.kind === 'scale') return ` · ${timesAs(motion.factors)}`;
  return '';
}

function rangeFields({ model, player }: CageEditor, { id, range }: CageEdit) {
  const frames = player.capture.frames;
  const { numbers } = player.transport;
  const field = (key: keyof FrameRange, label: string) => {
    // Ends are frames, shown by their numbers; eases are how many.
    const isEnd = key === 'first' || key === 'last';
    const shown = (value: number) => (isEnd ? frameText(numbers, value) : String(value));
    return html`<label class="muted"
      >${label}
      <input
        type="number"
        class="figures"
        min=${shown(0)}
        max=${shown(frames - 1)}
        step="any"
        .value=${shown(range[key])}
        @change=${(event: Event) => {
          const input = event.target as HTMLInputElement;
          const typed = isEnd ? placeOf(numbers, Number(input.value)) : Number(input.value);
          if (input.value !== '') model.setRange(id, { ...range, [key]: typed }, frames);
          // What does not fit was put right, perhaps to what it was before.
          input.value = shown(model.edits.find((other) => other.id === id)?.range[key] ?? range[key]);
        }}
    /></label>`;
  };
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
