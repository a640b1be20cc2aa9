import { html, nothing } from 'lit';
import type { Capture } from '../capture';
import { withEdits } from '../container/rewrite';
import { save } from '../save';
import { iconButton } from '../style/parts';
import { sentence } from '../text';
import { perform, stem } from './actions';
import type { CagerViewer } from './cagerViewer';
import { frameText } from './frameNumbers';
import { objOf } from './objText';
import type { Player } from './player';

/** What the capture can be saved as: what is seen, the frame, and all of it in the formats that there are. */
export function exportPanel(player: Player, viewer: CagerViewer, close: () => void) {
  const { capture } = player;
  const row = (name: string, ending: string, act: () => void) =>
    html`<li>
      <button class="quiet spread" @click=${act}><span>${name}</span><span class="muted">${ending}</span></button>
    </li>`;
  const download = (name: string, ending: string) =>
    row(
      name,
      `.${ending}`,
      () => void exporting(viewer, player, (onProgress) => saveAs(capture, ending, stem(viewer), onProgress)),
    );
  return html`<aside class="panel glass exports" aria-label="Export">
    <header class="spread">
      <h2>What is shown</h2>
      ${iconButton('close', 'Close', close)}
    </header>
    <ul>
      ${row('Image', '.png', () => perform('picture', viewer))}
      ${row('Turntable video', '.mp4, .webm', () => perform('turntable', viewer))}
      ${row('Points of this frame', '.obj', () => void exporting(viewer, player, () => saveFrame(player, viewer)))}
    </ul>
    <h2>All frames</h2>
    ${
      capture.complete
        ? html`<ul>
            ${capture.container ? download('CageR', 'cager') : nothing}
            ${Object.entries(capture.downloads?.formats ?? {}).map(([ending, name]) => download(name, ending))}
          </ul>`
        : html`<p class="muted">When the session is complete.</p>`
    }
    ${viewer.editing.hasEdits ? html`<p class="muted">Unsaved edits are left out. Save them in Edit cage.</p>` : nothing}
    ${capture.complete && !capture.downloads ? html`<p class="muted">Other formats: <code>cager decode</code>.</p>` : nothing}
  </aside>`;
}

/** Saves something while what is done is said, or why it failed. */
async function exporting(
  viewer: CagerViewer,
  player: Player,
  work: (onProgress: (part: number) => void) => Promise<void>,
) {
  const tell = (fraction: number | null) => {
    player.progress = { doing: 'Exporting', fraction };
    viewer.requestUpdate();
  };
  tell(null);
  try {
    await work(tell);
  } catch (error) {
    viewer.report(sentence(error));
  } finally {
    player.progress = null;
    viewer.requestUpdate();
  }
}

async function saveAs(capture: Capture, ending: string, name: string, onProgress: (part: number) => void) {
  if (capture.downloads) await capture.downloads.save(ending, name, onProgress);
  else save(await withEdits(await capture.container!(), capture.layers ?? [], { onProgress }), `${name}.cager`);
}

async function saveFrame(player: Player, viewer: CagerViewer) {
  const { frame } = viewer;
  const text = objOf(player.capture.static, await player.readPositions(frame));
  save(new Blob([text], { type: 'model/obj' }), `${stem(viewer)}-${frameText(player.transport.numbers, frame)}.obj`);
}
