import { html, nothing } from 'lit';
import type { CoordinateSystem } from '../capture';
import { SYSTEM_NAMES } from '../text';
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

const ACCURACY_HINTS: Readonly<Record<Choices['accuracy'], string>> = {
  standard: 'No point of any frame is off by more than 0.1 % of the model’s diagonal.',
  master: 'No point of any frame is off by more than 0.01 % of the model’s diagonal; files are larger.',
  bound: 'No point of any frame is off by more than you allow.',
  preview: 'The smallest files; detail that the cages cannot follow is lost.',
  cages: 'Cages are kept exactly; detail that they cannot follow is lost.',
};

interface NumberField {
  readonly min: number;
  readonly max?: number;
  readonly step?: number;
  readonly placeholder?: string;
  readonly isRequired?: boolean;
}

/** The fields of the form. `onChange` gets the choices anew whenever one is changed. */
export function optionsForm(choices: Choices, hasCage: boolean, onChange: (choices: Choices) => void) {
  const set = (key: keyof Choices) => (event: Event) =>
    onChange({ ...choices, [key]: (event.target as HTMLInputElement | HTMLSelectElement).value });
  const choice = (
    key: keyof Choices,
    label: string,
    words: Readonly<Record<string, string>>,
    hint = '',
    { isFixed = false, isWide = false } = {},
  ) =>
    html`<div class="field ${isWide ? 'wide' : ''}">
      <label for=${key}>${label}</label>
      <select id=${key} aria-describedby=${hint ? `${key}-hint` : nothing} ?disabled=${isFixed} @change=${set(key)}>
        ${Object.entries(words).map(([value, word]) => html`<option value=${value} ?selected=${choices[key] === value}>${word}</option>`)}
      </select>
      ${hint ? html`<span class="fine" id="${key}-hint">${hint}</span>` : nothing}
    </div>`;
  const number = (key: keyof Choices, label: string, { min, max, step, placeholder, isRequired }: NumberField) =>
    html`<div class="field">
      <label for=${key}>${label}</label>
      <input
        id=${key}
        type="number"
        min=${min}
        max=${max ?? nothing}
        step=${step ?? 'any'}
        placeholder=${placeholder ?? nothing}
        ?required=${isRequired === true}
        .value=${choices[key]}
        @input=${set(key)}
      />
    </div>`;
  const percent = { min: 0.0001, max: 99, isRequired: true };
  const isDesigned = !hasCage && choices.cage === 'motion';
  const cageFields = () => html`
    ${choice(
      'cage',
      'Cage',
      { rest: 'From the rest pose', motion: 'From the motion' },
      isDesigned ? 'Several times more accurate; takes about a minute longer.' : 'Ready within seconds.',
    )}
    ${isDesigned ? choice('cageGoal', 'Target', { vertices: 'vertex count', error: 'error' }) : nothing}
    ${
      isDesigned && choices.cageGoal === 'error'
        ? number('cageError', 'Mean error, in % of the diagonal', percent)
        : number('cageVertices', 'Maximum cage vertices', { min: 4, max: 20_000, step: 1, placeholder: '350' })
    }
    ${
      isDesigned
        ? number('cageSeconds', 'Design time limit, in seconds', {
            min: 1,
            max: 86_400,
            placeholder: 'service default',
          })
        : nothing
    }
  `;
  return html`
    <div class="options">
      <div class="field wide">
        <label for="name">Name</label>
        <input id="name" maxlength="200" autocomplete="off" .value=${choices.name} @input=${set('name')} />
      </div>
      ${choice(
        'accuracy',
        'Accuracy',
        {
          standard: 'Standard: visually lossless, 0.1 %',
          master: 'Master: 0.01 %',
          bound: 'Custom limit',
          preview: 'Preview: small, cages only',
          cages: 'Cages only, no error limit',
        },
        ACCURACY_HINTS[choices.accuracy],
        { isWide: true },
      )}
      ${choices.accuracy === 'bound' ? number('bound', 'Maximum error, in % of the diagonal', percent) : nothing}
      ${hasCage ? nothing : cageFields()}
      ${number('frameRate', 'Frames per second', { min: 0.001, placeholder: 'auto' })}
    </div>
    <details>
      <summary>More options</summary>
      <div class="options">
        ${choice(
          'coordinates',
          'Coordinates',
          SYSTEM_NAMES,
          isDesigned ? 'Cages are designed for mean value coordinates.' : 'How points follow the cage.',
          { isFixed: isDesigned },
        )}
      </div>
    </details>
  `;
}
