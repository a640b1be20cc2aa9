import { html, LitElement, nothing, type PropertyValues } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import { glyphs } from '../style/glyphs';
import { picturePanelStyle } from '../style/picturePanel';
import { controls } from '../style/controls';
import { sentence } from '../text';
import { editNotes, mouseAndKeys, editRow, layerRow } from './editParts';
import { editPanelStyle } from './editPanelStyle';
import type { CageEditor } from './editor';
import type { EditSettings, Reach } from './editModel';
import { exportEdited, obstacle, type ExportKind } from './exporter';
import type { Keeping } from './keptEdits';
import { TOOL_KEYS } from './keys';
import type { MotionKind } from './motion';
import { AXES, type Axis } from './symmetry';
import { iconButton, segments } from '../style/parts';

/** Largest radius of the falloff, as a fraction of the rest pose's diagonal. */
const LARGEST_RADIUS = 0.6;
const REACHES: readonly (readonly [Reach, string])[] = [
  ['frame', 'This frame'],
  ['around', 'Nearby frames'],
  ['all', 'All frames'],
];

const TOOLS: readonly (readonly [MotionKind, string, string])[] = [
  ['move', 'Move', `Move (${TOOL_KEYS.move.toUpperCase()})`],
  ['rotate', 'Rotate', `Rotate (${TOOL_KEYS.rotate.toUpperCase()})`],
  ['scale', 'Scale', `Scale (${TOOL_KEYS.scale.toUpperCase()})`],
];

/**
 * The controls of a {@link CageEditor}.
 *
 * @fires leave when editing is to end
 * @fires problem with one sentence, when an export failed
 */
@customElement('cager-edit-panel')
export class EditPanel extends LitElement {
  static override styles = [controls, picturePanelStyle, editPanelStyle];

  @property({ attribute: false }) editor!: CageEditor;
  /** What exported files are named after. */
  @property() name = 'capture';
  /** Whether the edits are there after a reload. */
  @property() keeping: Keeping = 'kept';
  @state() private exporting: { kind: ExportKind; fraction: number; stop: AbortController } | null = null;
  private readonly refresh = () => this.requestUpdate();

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.editor.removeEventListener('change', this.refresh);
    this.exporting?.stop.abort();
  }

  protected override willUpdate(changed: PropertyValues<this>) {
    if (!changed.has('editor')) return;
    changed.get('editor')?.removeEventListener('change', this.refresh);
    this.editor.addEventListener('change', this.refresh);
  }

  override render() {
    const { model, said } = this.editor;
    const { edits, layers } = model;
    const count = edits.length + layers.length;
    return html`<section class="panel glass" aria-label="Edit cage" @keydown=${this.keepKey}>
      <header>
        <h2 class="grow">Edit cage</h2>
        ${this.action('undo', 'Undo (Ctrl Z)', !model.canUndo, () => model.undo())}
        ${this.action('redo', 'Redo (Ctrl Shift Z)', !model.canRedo, () => model.redo())}
        ${this.action('reset', 'Remove all edits', count === 0, () => model.reset())}
        ${iconButton('close', 'Done', () => this.leave(), 'Done (E)')}
      </header>
      <p class="visually-hidden" role="status">${said}</p>
      <div class="body">
        ${this.selectionRow()} ${this.toolRow()} ${this.settingRows(model.settings)}
        <h3 class="setting fine">Edits</h3>
        ${
          count === 0
            ? html`<p class="muted">No edits yet: drag a vertex of the cage.</p>`
            : html`<ul>
                ${layers.map((layer, k) => layerRow(this.editor, layer, k))}
                ${edits.map((edit) => editRow(this.editor, edit))}
              </ul>`
        }
        ${editNotes(this.editor.player.capture.static, this.keeping)} ${mouseAndKeys}
      </div>
      ${this.exportRow()}
    </section>`;
  }

  private selectionRow() {
    const { model } = this.editor;
    const { selection } = model;
    const chosen =
      selection.length === 0
        ? 'None selected'
        : selection.length === 1
          ? `Vertex ${selection[0]}`
          : `${selection.length} vertices`;
    const toggle = () => {
      this.editor.addsToSelection = !this.editor.addsToSelection;
      this.requestUpdate();
    };
    return html`<div class="row">
      <strong class="figures grow">${chosen}</strong>
      <button
        aria-pressed=${this.editor.addsToSelection}
        title="Clicks add to the selection, as with Shift"
        @click=${toggle}
      >
        Multi-select
      </button>
      <button ?disabled=${selection.length === 0} @click=${() => this.editor.select([])}>Deselect</button>
    </div>`;
  }

  private toolRow() {
    const { editor } = this;
    const isAlone = editor.model.selection.length === 1 && editor.model.settings.radius === 0;
    return html`${segments('Tool', TOOLS, editor.tool, (tool) => (editor.tool = tool))}
    ${
      isAlone && editor.tool !== 'move'
        ? html`<p class="muted">A single vertex has nothing to turn or scale: select more, or set a falloff.</p>`
        : nothing
    }`;
  }

  private settingRows(settings: EditSettings) {
    const { model } = this.editor;
    const set = (part: Partial<EditSettings>) => (model.settings = { ...settings, ...part });
    const percent = Math.round(100 * settings.radius);
    const planes = [null, ...AXES];
    return html`
      <label class="setting spread fine" for="radius">
        <span>Falloff</span><output class="figures">${percent === 0 ? 'off' : `${percent} % of the diagonal`}</output>
      </label>
      <div class="row">
        <input
          id="radius"
          type="range"
          min="0"
          max=${100 * LARGEST_RADIUS}
          step="1"
          .value=${String(percent)}
          @input=${(event: Event) => set({ radius: Number((event.target as HTMLInputElement).value) / 100 })}
        />
        <select
          aria-label="Falloff distance"
          @change=${(event: Event) =>
            set({ measure: (event.target as HTMLSelectElement).value === 'space' ? 'space' : 'surface' })}
        >
          <option value="surface" .selected=${settings.measure === 'surface'}>Along the surface</option>
          <option value="space" .selected=${settings.measure === 'space'}>Through space</option>
        </select>
      </div>
      <div class="setting fine" id="symmetry">Symmetry</div>
      <div class="segments" role="group" aria-labelledby="symmetry">
        ${planes.map((axis) => this.planeButton(axis, settings, () => set({ symmetry: axis })))}
      </div>
      <div class="setting fine" aria-hidden="true">Apply new edits to</div>
      ${segments('Apply new edits to', REACHES, settings.reach, (reach) => set({ reach }))}
    `;
  }

  private planeButton(axis: Axis | null, settings: EditSettings, choose: () => void) {
    const mirror = axis && this.editor.model.mirrors.get(axis);
    const title = !axis
      ? 'No mirroring'
      : mirror
        ? `Mirror across ${axis}: ${Math.round(100 * mirror.share)} % of the vertices match`
        : `The cage is not symmetric across ${axis}`;
    return html`<button
      aria-pressed=${settings.symmetry === axis}
      aria-label=${axis ? `Across ${axis}` : 'Off'}
      title=${title}
      ?disabled=${axis !== null && !mirror}
      @click=${choose}
    >
      ${axis ? axis.toUpperCase() : 'Off'}
    </button>`;
  }

  private exportRow() {
    const { exporting } = this;
    if (exporting) {
      return html`<footer class="row">
        <progress aria-label="Exporting" max="1" .value=${exporting.fraction}></progress>
        <button @click=${() => exporting.stop.abort()}>Cancel</button>
      </footer>`;
    }
    const button = (kind: ExportKind, label: string, title: string) => {
      const reason = obstacle(this.editor.player.capture, kind);
      return html`<button title=${reason ?? title} ?disabled=${reason !== null} @click=${() => void this.export(kind)}>
        ${label}
      </button>`;
    };
    return html`<footer class="row" aria-label="Export">
      ${button('container', 'Save .cager', 'The capture with all enabled edits, to play or to decode')}
      ${button('frames', 'Save positions (.npy)', 'All points of all frames with all enabled edits, as a NumPy array')}
    </footer>`;
  }

  private async export(kind: ExportKind) {
    const stop = new AbortController();
    const onProgress = (fraction: number) => (this.exporting = { kind, fraction, stop });
    onProgress(0);
    try {
      const { player, model } = this.editor;
      await exportEdited(player.capture, model.edits, kind, this.name, { signal: stop.signal, onProgress });
    } catch (error) {
      if (!stop.signal.aborted) {
        const detail = sentence(error);
        this.dispatchEvent(new CustomEvent<string>('problem', { detail }));
      }
    } finally {
      this.exporting = null;
    }
  }

  private action(name: 'undo' | 'redo' | 'reset', label: string, isDisabled: boolean, act: () => void) {
    return html`<button
      class="quiet icon"
      title=${label}
      aria-label=${label.replace(/ \(.*/, '')}
      ?disabled=${isDisabled}
      @click=${act}
    >
      ${glyphs[name]}
    </button>`;
  }

  private leave() {
    this.dispatchEvent(new Event('leave'));
  }

  /** Keys of a field are the field's: arrows move its value, not the capture. */
  private keepKey(event: KeyboardEvent) {
    const target = event.composedPath()[0] as HTMLElement;
    if (/^(INPUT|SELECT)$/.test(target.tagName) && event.key !== 'Escape') event.stopPropagation();
  }
}
