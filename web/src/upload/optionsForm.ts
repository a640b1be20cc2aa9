import { html } from 'lit';
import type { CoordinateSystem } from '../capture';
import type { SessionOptions } from '../service/messages';

/** What somebody chose; empty texts are the service's defaults. */
export interface Choices {
  readonly name: string;
  readonly coordinates: CoordinateSystem;
  readonly accuracy: 'cages' | 'preview' | 'standard' | 'master' | 'bound';
  /** Largest error in per cent of the diagonal, for the accuracy `bound`. */
  readonly bound: string;
  readonly frameRate: string;
  readonly cageVertices: string;
  readonly send: 'auto' | 'all' | 'handles';
}

export const DEFAULT_CHOICES: Choices = {
  name: '',
  coordinates: 'mvc',
  accuracy: 'cages',
  bound: '0.1',
  frameRate: '',
  cageVertices: '',
  send: 'auto',
};

/** From here on, `auto` sends handle rows alone: whole frames would take long, and errors are a luxury then. */
const LARGE_BYTES = 64 << 20;

/** The options of a session. */
export function optionsOf(choices: Choices, frames: number, hasCage: boolean): SessionOptions {
  const options: SessionOptions = { frames, coordinates: choices.coordinates };
  const name = choices.name.trim();
  if (name !== '') options.name = name.slice(0, 200);
  const rate = Number(choices.frameRate);
  if (choices.frameRate.trim() !== '' && rate > 0) options.frame_rate = rate;
  const vertices = Number(choices.cageVertices);
  if (!hasCage && choices.cageVertices.trim() !== '') options.cage = { vertices };
  if (choices.accuracy === 'bound') options.max_error = Number(choices.bound) / 100;
  else if (choices.accuracy !== 'cages') options.quality = choices.accuracy;
  return options;
}

/** Whether handle rows alone shall be sent of a capture of so many bytes, where the session allows it. */
export function sendsHandles(choices: Choices, bytes: number): boolean {
  return choices.send === 'handles' || (choices.send === 'auto' && bytes > LARGE_BYTES);
}

/** The fields of the form. `onChange` gets the choices anew whenever one is changed. */
export function optionsForm(choices: Choices, hasCage: boolean, onChange: (choices: Choices) => void) {
  const set = (key: keyof Choices) => (event: Event) =>
    onChange({ ...choices, [key]: (event.target as HTMLInputElement | HTMLSelectElement).value });
  const option = (key: keyof Choices, value: string, word: string) =>
    html`<option value=${value} ?selected=${choices[key] === value}>${word}</option>`;
  const isCoded = choices.accuracy !== 'cages';
  return html`
    <div class="options">
      <div class="field wide">
        <label for="name">Name</label>
        <input id="name" maxlength="200" autocomplete="off" .value=${choices.name} @input=${set('name')} />
      </div>
      <div class="field">
        <label for="accuracy">Accuracy</label>
        <select id="accuracy" aria-describedby="accuracy-hint" @change=${set('accuracy')}>
          ${option('accuracy', 'cages', 'As the cage allows')}
          ${option('accuracy', 'preview', 'Preview: small, cages alone')}
          ${option('accuracy', 'standard', 'Standard: errors nobody sees')}
          ${option('accuracy', 'master', 'Master: 0.01 % at most')} ${option('accuracy', 'bound', 'An error of my own')}
        </select>
        <span class="hint" id="accuracy-hint">
          ${isCoded ? 'Frames are coded in groups, and the container is small.' : 'Cages are kept exactly; details that they cannot follow are lost.'}
        </span>
      </div>
      ${
        choices.accuracy === 'bound'
          ? html`<div class="field">
              <label for="bound">Largest error, in % of the diagonal</label>
              <input
                id="bound"
                type="number"
                min="0.0001"
                max="99"
                step="any"
                required
                .value=${choices.bound}
                @input=${set('bound')}
              />
            </div>`
          : ''
      }
      <div class="field">
        <label for="frame-rate">Frames per second</label>
        <input
          id="frame-rate"
          type="number"
          min="0.001"
          step="any"
          placeholder="not said"
          .value=${choices.frameRate}
          @input=${set('frameRate')}
        />
      </div>
    </div>
    <details>
      <summary>More options</summary>
      <div class="options">
        <div class="field">
          <label for="coordinates">Coordinates</label>
          <select id="coordinates" @change=${set('coordinates')}>
            ${option('coordinates', 'mvc', 'Mean value')} ${option('coordinates', 'harmonic', 'Harmonic')}
            ${option('coordinates', 'green', 'Green')} ${option('coordinates', 'green-free', 'Green, free normals')}
          </select>
        </div>
        ${
          hasCage
            ? ''
            : html`<div class="field">
                <label for="cage-vertices">Vertices of the cage, at most</label>
                <input
                  id="cage-vertices"
                  type="number"
                  min="4"
                  max="20000"
                  step="1"
                  placeholder="350"
                  .value=${choices.cageVertices}
                  @input=${set('cageVertices')}
                />
              </div>`
        }
        <div class="field">
          <label for="send">What is sent</label>
          <select id="send" aria-describedby="send-hint" ?disabled=${isCoded} @change=${set('send')}>
            ${option('send', 'auto', 'Choose by size')} ${option('send', 'all', 'Whole frames')}
            ${option('send', 'handles', 'What the solver reads')}
          </select>
          <span class="hint" id="send-hint">
            ${isCoded ? 'This accuracy needs whole frames.' : 'The solver reads a few hundred points of a frame. Errors are measured of whole frames alone.'}
          </span>
        </div>
      </div>
    </details>
  `;
}
