import { html, nothing, type TemplateResult } from 'lit';
import { HEAT } from '../render/colorMap';
import type { Side } from '../render/drawn';
import type { Dropped } from '../files/classify';
import { pickFiles } from '../files/drop';
import { glyphs } from '../style/glyphs';
import type { HeatRange, MeasuredFrame } from './heatMap';
import type { Player } from './player';
import { count, percent, threeDigits } from '../text';
import { iconButton, segments } from '../style/parts';

export interface ComparisonActs {
  open(files: readonly Dropped[]): void;
  close(): void;
}

const SIDE_NAMES: Readonly<Record<Side, string>> = {
  decoded: 'Decoded',
  both: 'Both',
  ghost: 'Ghost',
  original: 'Original',
};
/** The same where the original is no model but surfaces. */
const SURFACE_NAMES: typeof SIDE_NAMES = { ...SIDE_NAMES, decoded: 'Template', original: 'Observed' };
/** Rounding of the picture that is a larger part of the errors than this is told. */
const TELLING_PART = 0.05;
/** A root mean square beyond this, in diagonals, means that the files are of something else. */
const UNLIKELY_ERROR = 0.1;
/** How far a press of an arrow key moves the line between both sides. */
const KEY_STEP = 0.02;

/** The colour bar, how to compare, and figures of the frame; or where the original could come from. */
export function comparisonPanel(player: Player, acts: ComparisonActs): TemplateResult {
  const { comparison, heatMap } = player;
  const { original, surfaces } = comparison;
  const compared = original ?? surfaces;
  if (!compared) {
    const wanted = player.capture.tracking ? 'surfaces that it was recovered from' : 'original frames';
    return html`<p>Drop the ${wanted} here to see the error of each point. They are not uploaded.</p>
      <button @click=${() => pickFiles((files) => acts.open(files), { accept: '.npy,.pc2,.mdd,.obj,.ply' })}>
        ${glyphs.file} Choose files
      </button>`;
  }
  const names = surfaces ? SURFACE_NAMES : SIDE_NAMES;
  const what = surfaces ? 'Distance from the surface' : 'Error against the original';
  const sides = comparison.sides.map((side) => [side, names[side]] as const);
  const { measured } = heatMap;
  const showsErrors = heatMap.kind === 'error' && measured !== null;
  return html`
    <div class="source row">
      <span class="grow clip" title=${compared.name}>${showsErrors ? what : compared.name}</span>
      ${iconButton('close', 'Close the original', acts.close)}
    </div>
    ${showsErrors ? [errorFigures(player, measured), surfaces ? nothing : rangeChoice(player)] : nothing}
    ${segments('Show', sides, comparison.side, (side) => (comparison.side = side))}
  `;
}

const RANGES: readonly (readonly [HeatRange, string])[] = [
  ['clip', 'Whole clip'],
  ['frame', 'This frame'],
];

/** Which points the warm end of the colours is of: 99 of 100 stay below it. */
export function rangeChoice(player: Player) {
  const { kind, range } = player.heatMap;
  return segments('Colour range (99th percentile)', RANGES, range, (each) => player.setHeat(kind, each));
}

/** The colours of the heat map from 0 to the warmest, in percent of the diagonal and in the unit of the files. */
export function colorScale({ heatMap: { largest }, stage }: Player, more: string) {
  return html`<div class="bar" .style=${`background: ${HEAT.gradient}`}></div>
    <div class="spread muted figures">
      <span>0</span
      ><span>${more}${percent(largest)} of the diagonal (${threeDigits(largest * stage.decoder.diagonal)})</span>
    </div>`;
}

function errorFigures(player: Player, { worst, largest, l2 }: MeasuredFrame) {
  const { heatMap, stage, comparison } = player;
  const { diagonal, precision } = stage.decoder;
  return html`${colorScale(player, heatMap.largest < largest ? '≥ ' : '')}
    <dl class="pairs">
      <dt>Worst point, ${count(worst)}</dt>
      <dd>${percent(largest)} (${threeDigits(largest * diagonal)})</dd>
      <dt>RMS</dt>
      <dd>${percent(l2)} (${threeDigits(l2 * diagonal)})</dd>
    </dl>
    ${
      l2 > UNLIKELY_ERROR
        ? html`<p class="muted">
            This is far off: the files may use another unit, or have
            ${comparison.surfaces ? 'other frames' : 'another point order'}.
          </p>`
        : precision.error > TELLING_PART * largest
          ? html`<p class="muted">Up to ${percent(precision.error)} of this is rounding in this view.</p>`
          : nothing
    }`;
}

/** The line between the original and the decoded model, to be dragged; `--line` says how far from the left it is drawn. */
export function divider({ comparison, stage }: Player) {
  if (!comparison.original || comparison.side !== 'both') return nothing;
  const drag = (event: PointerEvent) => {
    const line = event.currentTarget as HTMLElement;
    if (event.type === 'pointerdown') line.setPointerCapture(event.pointerId);
    if (!line.hasPointerCapture(event.pointerId)) return;
    comparison.split = stage.splitAt(event.clientX - line.parentElement!.getBoundingClientRect().left);
  };
  const press = (event: KeyboardEvent) => {
    const step = { ArrowLeft: -KEY_STEP, ArrowRight: KEY_STEP }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    comparison.split += step;
  };
  const share = Math.round(100 * comparison.split);
  return html`<div
    class="divider"
    role="slider"
    tabindex="0"
    aria-label="Divider between original and decoded model"
    aria-valuemin="0"
    aria-valuemax="100"
    aria-valuenow=${share}
    aria-valuetext=${`${share} % original`}
    @pointerdown=${drag}
    @pointermove=${drag}
    @keydown=${press}
  >
    <span class="left">Original</span><span class="right">Decoded</span>
  </div>`;
}
