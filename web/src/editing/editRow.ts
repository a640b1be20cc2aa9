import { html, nothing } from 'lit';
import type { CageEdit, FrameRange } from './cageEdit';
import { iconButton } from '../style/parts';
import type { CageEditor } from './editor';
import { angleOf, type Motion, degrees, timesAs } from './motion';

/** An edit in the list: whether it counts, its vertices and frames; of the one that is worked on, fields for its range. */
export function editRow(editor: CageEditor, edit: CageEdit) {
  const { model } = editor;
  const { id, grip, motion, range, enabled } = edit;
  const { chosen } = grip;
  const name = chosen.length === 1 ? `Vertex ${chosen[0]}` : `${chosen.length} vertices`;
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
        <span class="muted figures">${range.first === range.last ? range.first : `${range.first}–${range.last}`}</span>
      </button>
      ${iconButton('trash', `Remove edit of ${name}`, () => model.remove(id), 'Remove')}
    </div>
    ${isActive ? rangeFields(editor, edit) : nothing}
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
