import { html, nothing } from 'lit';
import { glyphs } from '../style/glyphs';
import { counted, size } from '../text';
import type { Dropped, Item, Role } from '../files/classify';
import { pickFiles } from '../files/drop';
import type { Choices } from './optionsForm';
import type { Plan } from './plan';

const ROLE_WORDS: Readonly<Record<Role, string>> = {
  rest: 'Rest pose',
  cage: 'Cage',
  frames: 'Frames',
  unused: 'Not used',
};

/** Where files are dropped; large, with what they may be, until the first is there. */
export function dropZone(isOver: boolean, isFirst: boolean, take: (files: Dropped[]) => void, startOver: () => void) {
  const pick = (isFolder: boolean) => () => pickFiles(take, { isFolder });
  return html`
    <div class="zone ${isOver ? 'over' : ''} ${isFirst ? '' : 'small'}">
      ${
        isFirst
          ? html`${glyphs.upload}
              <h2>Drop a rest pose, frames and, if you have one, a cage</h2>
              <p class="muted">Together or one by one. Nothing is uploaded until you start.</p>`
          : nothing
      }
      <div class="buttons">
        <button type="button" class=${isFirst ? 'primary' : ''} @click=${pick(false)}>
          ${isFirst ? 'Choose files' : 'Add files'}
        </button>
        <button type="button" @click=${pick(true)}>${isFirst ? 'Choose folder' : 'Add folder'}</button>
        ${isFirst ? nothing : html`<button type="button" class="quiet" @click=${startOver}>Start over</button>`}
      </div>
    </div>
    ${
      isFirst
        ? html`<ul class="kinds">
            <li class="card">
              <b>Rest pose</b><span class="fine">The undeformed mesh: .obj, .ply, .off, .stl or .glb</span>
            </li>
            <li class="card">
              <b>Frames</b
              ><span class="fine">.npy (frames × points × 3), .pc2, .mdd, or a folder with one .obj per frame</span>
            </li>
            <li class="card">
              <b>Cage (optional)</b
              ><span class="fine">A coarse closed mesh around the rest pose; created for you if missing</span>
            </li>
          </ul>`
        : nothing
    }
  `;
}

export function itemRow(item: Item, onRole: (role: Role) => void) {
  const bytes = item.files.reduce((sum, file) => sum + file.size, 0);
  return html`
    <li>
      <span class="title clip ${item.role === 'unused' ? 'unused' : ''}" title=${item.name}>${item.name}</span>
      <span class="muted figures">${size(bytes)}</span>
      ${
        item.choices.length > 1
          ? html`<select
              aria-label="Role of ${item.name}"
              .value=${item.role}
              @change=${(event: Event) => onRole((event.target as HTMLSelectElement).value as Role)}
            >
              ${item.choices.map((role) => html`<option value=${role} ?selected=${role === item.role}>${ROLE_WORDS[role]}</option>`)}
            </select>`
          : html`<span class="muted">${ROLE_WORDS[item.role]}</span>`
      }
      ${item.remark ? html`<span class="remark fine">${item.remark}</span>` : nothing}
    </li>
  `;
}

export function planSummary({ frames, cage, remarks }: Plan, choices: Choices) {
  const bytes = 12 * frames.frames * frames.points;
  const sentences = [
    `${counted(frames.frames, 'frame')} of ${counted(frames.points, 'point')}, ${size(bytes)} in single precision.`,
    cage || choices.cage === 'motion' ? '' : 'A cage is created around the rest pose.',
    ...remarks,
  ];
  return html`<div class="note">
    ${glyphs.file}
    <p>${sentences.filter(Boolean).join(' ')}</p>
  </div>`;
}
