import { html } from 'lit';
import type { CoordinateSystem } from '../capture';
import type { DesignOptions, SessionOptions } from '../service/messages';

/** What somebody chose; empty texts are the service's defaults. */
export interface Choices {
  readonly name: string;
  readonly coordinates: CoordinateSystem;
  readonly accuracy: 'cages' | 'preview' | 'standard' | 'master' | 'bound';
  /** Largest error in per cent of the diagonal, for the accuracy `bound`. */
  readonly bound: string;
  readonly frameRate: string;
  /** Where a cage comes from that nobody gave: made around the rest pose, or designed from the motion. */
  readonly cage: 'rest' | 'motion';
  readonly cageVertices: string;
  /** Whether a designed cage has so many vertices, or as few as keep an error. */
  readonly cageGoal: 'vertices' | 'error';
  /** That error, in per cent of the diagonal. */
  readonly cageError: string;
  readonly cageSeconds: string;
}

export const DEFAULT_CHOICES: Choices = {
  name: '',
  coordinates: 'mvc',
  accuracy: 'standard',
  bound: '0.1',
  frameRate: '',
  cage: 'rest',
  cageVertices: '',
  cageGoal: 'vertices',
  cageError: '0.1',
  cageSeconds: '',
};

/** Largest error of the accuracy `standard`, as a fraction of the diagonal: nobody sees it. */
const STANDARD_ERROR = 0.001;

/** The options of a session. */
export function optionsOf(choices: Choices, frames: number, hasCage: boolean): SessionOptions {
  const isDesigned = !hasCage && choices.cage === 'motion';
  const options: SessionOptions = { frames, coordinates: isDesigned ? 'mvc' : choices.coordinates };
  const name = choices.name.trim();
  if (name !== '') options.name = name.slice(0, 200);
  const rate = Number(choices.frameRate);
  if (choices.frameRate.trim() !== '' && rate > 0) options.frame_rate = rate;
  const vertices = Number(choices.cageVertices);
  if (!hasCage && !isDesigned && choices.cageVertices.trim() !== '') options.cage = { vertices };
  if (choices.accuracy === 'bound') options.max_error = Number(choices.bound) / 100;
  else if (choices.accuracy === 'standard') options.max_error = STANDARD_ERROR;
  else if (choices.accuracy !== 'cages') options.quality = choices.accuracy;
  return options;
}

/** What the cage is to be that is designed from the motion; null where none is. */
export function designOf(choices: Choices, hasCage: boolean): DesignOptions | null {
  if (hasCage || choices.cage !== 'motion') return null;
  const options: DesignOptions = {};
  const [name, vertices, seconds] = [choices.name, choices.cageVertices, choices.cageSeconds].map((text) =>
    text.trim(),
  );
  if (name !== '') options.name = name.slice(0, 200);
  if (choices.cageGoal === 'error') options.mean_error = Number(choices.cageError) / 100;
  else if (vertices !== '') options.vertices = Number(vertices);
  if (seconds !== '') options.time_limit_s = Number(seconds);
  return options;
}

/** The fields of the form. `onChange` gets the choices anew whenever one is changed. */
export function optionsForm(choices: Choices, hasCage: boolean, onChange: (choices: Choices) => void) {
  const set = (key: keyof Choices) => (event: Event) =>
    onChange({ ...choices, [key]: (event.target as HTMLInputElement | HTMLSelectElement).value });
  const option = (key: keyof Choices, value: string, word: string) =>
    html`<option value=${value} ?selected=${choices[key] === value}>${word}</option>`;
  const isCoded = choices.accuracy !== 'cages';
  const isDesigned = !hasCage && choices.cage === 'motion';
  return html`
    <div class="options">
      <div class="field wide">
        <label for="name">Name</label>
        <input id="name" maxlength="200" autocomplete="off" .value=${choices.name} @input=${set('name')} />
      </div>
      <div class="field">
        <label for="accuracy">Accuracy</label>
        <select id="accuracy" aria-describedby="accuracy-hint" @change=${set('accuracy')}>
          ${option('accuracy', 'standard', 'Standard: visually lossless, 0.1 % at most')}
          ${option('accuracy', 'master', 'Master: 0.01 % at most')} ${option('accuracy', 'bound', 'Custom limit')}
          ${option('accuracy', 'preview', 'Preview: small, cages only')}
          ${option('accuracy', 'cages', 'Cages only, no error limit')}
        </select>
        <span class="fine" id="accuracy-hint">
          ${isCoded ? 'Frames are compressed in groups; files are small.' : 'Cages are kept exactly; detail that they cannot follow is lost.'}
        </span>
      </div>
      ${
        choices.accuracy === 'bound'
          ? html`<div class="field">
              <label for="bound">Maximum error, in % of the diagonal</label>
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
      ${hasCage ? '' : cageFields(choices, set, option)}
      <div class="field">
        <label for="frame-rate">Frames per second</label>
        <input
          id="frame-rate"
          type="number"
          min="0.001"
          step="any"
          placeholder="auto"
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
          <select
            id="coordinates"
            aria-describedby="coordinates-hint"
            ?disabled=${isDesigned}
            @change=${set('coordinates')}
          >
            ${option('coordinates', 'mvc', 'Mean value')} ${option('coordinates', 'harmonic', 'Harmonic')}
            ${option('coordinates', 'green', 'Green')} ${option('coordinates', 'green-free', 'Green, free normals')}
          </select>
          <span class="fine" id="coordinates-hint">
            ${isDesigned ? 'Cages are designed for mean value coordinates.' : 'How points follow the cage.'}
          </span>
        </div>
      </div>
    </details>
  `;
}

type Set = (key: keyof Choices) => (event: Event) => void;
type Option = (key: keyof Choices, value: string, word: string) => unknown;

/** Where the cage comes from, and what it is to be. */
function cageFields(choices: Choices, set: Set, option: Option) {
  const isDesigned = choices.cage === 'motion';
  const isError = isDesigned && choices.cageGoal === 'error';
  const number = (key: 'cageVertices' | 'cageError' | 'cageSeconds', label: string, rest: NumberField) =>
    html`<div class="field">
      <label for=${key}>${label}</label>
      <input
        id=${key}
        type="number"
        min=${rest.min}
        max=${rest.max}
        step=${rest.step}
        placeholder=${rest.placeholder}
        ?required=${rest.isRequired}
        .value=${choices[key]}
        @input=${set(key)}
      />
    </div>`;
  return html`
    <div class="field">
      <label for="cage">Cage</label>
      <select id="cage" aria-describedby="cage-hint" @change=${set('cage')}>
        ${option('cage', 'rest', 'From the rest pose')} ${option('cage', 'motion', 'From the motion')}
      </select>
      <span class="fine" id="cage-hint">
        ${isDesigned ? 'Several times more accurate; takes about a minute longer.' : 'Ready within seconds.'}
      </span>
    </div>
    ${
      isDesigned
        ? html`<div class="field">
            <label for="cage-goal">Target</label>
            <select id="cage-goal" @change=${set('cageGoal')}>
              ${option('cageGoal', 'vertices', 'vertex count')} ${option('cageGoal', 'error', 'error')}
            </select>
          </div>`
        : ''
    }
    ${
      isError
        ? number('cageError', 'Mean error, in % of the diagonal', {
            min: '0.0001',
            max: '99',
            step: 'any',
            placeholder: '',
            isRequired: true,
          })
        : number('cageVertices', 'Maximum cage vertices', {
            min: '4',
            max: '20000',
            step: '1',
            placeholder: '350',
            isRequired: false,
          })
    }
    ${
      isDesigned
        ? number('cageSeconds', 'Design time limit, in seconds', {
            min: '1',
            max: '86400',
            step: 'any',
            placeholder: 'service default',
            isRequired: false,
          })
        : ''
    }
  `;
}

interface NumberField {
  readonly min: string;
  readonly max: string;
  readonly step: string;
  readonly placeholder: string;
  readonly isRequired: boolean;
}
