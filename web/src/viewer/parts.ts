import { html, nothing, type TemplateResult } from 'lit';
import type { FrameErrors, UpAxis } from '../capture';
import type { FrameRange } from '../editing/cageEdit';
import { colorScale, comparisonPanel, rangeChoice, type ComparisonActs } from './comparisonParts';
import { frameText, numberAt, numberText } from './frameNumbers';
import { glyphs } from '../style/glyphs';
import type { Player } from './player';
import { isLost } from './reports';
import { keyLabel } from './shortcuts';
import { count, percent, threeDigits, clock } from '../text';
import './timeline';
import { tool, upButton, type Act } from './toolbar';
import { sought, SPEEDS, type Repeat, type Transport } from './transport';

export function titleBox(heading: string, { capture, up }: Player, isEdited: boolean, setUp: (up: UpAxis) => void) {
  const { static: part, frames, tracking, frameNumbers } = capture;
  // Frames are counted from 0 unless they have numbers of their own: the place beside the timeline is one of these.
  const [first, last] = [0, Math.max(0, frames - 1)].map((frame) => frameText(frameNumbers, frame));
  const lost = tracking?.outcomes.filter((_, frame) => isLost(tracking, frame)).length ?? 0;
  return html`<div class="title glass">
    <h1 class="heading clip" title=${heading}>${heading}</h1>
    <p class="figures fine clip">
      ${isEdited ? 'Edited · ' : ''}${count(part.rest.length / 3)} points, ${count(frames)}
      frames${frames > 1 ? ` (${first}–${last})` : nothing}<span class="more"
        >, cage of ${count(part.cage.positions.length / 3)} vertices</span
      >${lost > 0 ? html`, <span class="lost">${count(lost)} lost</span>` : nothing}
    </p>
    ${upButton(up, setUp)}
  </div>`;
}

/** What the timeline shows beside the capture's own errors: those of a second capture, the range of an edit, and which frames are edited. */
interface TimelineParts {
  readonly besideErrors: FrameErrors | null;
  readonly range: FrameRange | null;
  readonly edited: ((frame: number) => boolean) | null;
}

export function deck(player: Player, act: Act, { besideErrors, range, edited }: TimelineParts) {
  const { capture, transport } = player;
  const figures = capture.tracking ? scoreFigure : capture.errors.linf.some(Number.isFinite) ? errorFigures : null;
  return html`<div class="deck glass">
    ${transportBar(player, act, (speed) => (player.transport = { ...transport, speed }), figures)}
    <cager-timeline
      .frames=${capture.frames}
      .errors=${capture.errors}
      .besideErrors=${besideErrors}
      .tracking=${capture.tracking}
      .frameNumbers=${capture.frameNumbers}
      .range=${range}
      .edited=${edited}
      .played=${transport.range}
      .position=${transport.position}
      @seek=${(event: CustomEvent<number>) => (player.transport = sought(player.transport, event.detail))}
    ></cager-timeline>
  </div>`;
}

const REPEATS: Readonly<Record<Repeat, string>> = { once: 'Loop', loop: 'Loop', 'ping-pong': 'Loop: ping-pong' };

const isBegun = ({ range }: Transport) => range !== null && range[0] > 0;
const isEnded = ({ range, frames }: Transport) => range !== null && range[1] < frames - 1;

function transportBar(player: Player, act: Act, onSpeed: (speed: number) => void, figures: TemplateResult | null) {
  const { transport } = player;
  return html`<div class="transport row">
    <button
      class="primary play"
      title="${transport.playing ? 'Pause' : 'Play'} (${keyLabel('play')})"
      aria-label=${transport.playing ? 'Pause' : 'Play'}
      @click=${() => act('play')}
    >
      ${glyphs[transport.playing ? 'pause' : 'play']}
    </button>
    ${tool('previous', 'previous', act)} ${tool('next', 'next', act)}
    ${tool('loop', transport.repeat === 'ping-pong' ? 'pingPong' : 'loop', act, transport.repeat !== 'once', REPEATS[transport.repeat])}
    ${tool('in', 'in', act, isBegun(transport))} ${tool('out', 'out', act, isEnded(transport))}
    ${figures ? tool('worst', 'worst', act) : nothing}
    <select
      class="figures"
      aria-label="Speed"
      title="Speed"
      @change=${(event: Event) => onSpeed(Number((event.target as HTMLSelectElement).value))}
    >
      ${SPEEDS.map((speed) => html`<option value=${speed} .selected=${speed === transport.speed}>${speed}×</option>`)}
    </select>
    <span class="rate muted figures">${threeDigits(transport.speed * transport.rate)} fps</span>
    <div class="place row figures">
      <span data-place title="Frame / last frame"></span><span class="clock muted" data-clock></span>
    </div>
    ${figures ?? nothing}
  </div>`;
}

const errorFigures = html`<dl class="errors row figures">
  <div class="row" title="RMS distance over all points, relative to the diagonal">
    <dt><i class="key"></i></dt>
    <dt>L2</dt>
    <dd data-l2></dd>
  </div>
  <div class="row" title="Largest distance of any point, relative to the diagonal">
    <dt><i class="key linf"></i></dt>
    <dt>L∞</dt>
    <dd data-linf></dd>
  </div>
</dl>`;

const scoreFigure = html`<dl class="errors row figures">
  <div class="row" title="Distance of the template from the surface, relative to the diagonal; lower is better">
    <dt><i class="key"></i></dt>
    <dt>Score</dt>
    <dd data-score></dd>
  </div>
</dl>`;

/** What the colours of the heat map mean, and how the original compares. */
export function legend(player: Player, acts: ComparisonActs, beside: boolean) {
  const { heatMap, comparison } = player;
  if (heatMap.kind === 'none' && !comparison.isOpen) return nothing;
  const isMotion = heatMap.kind === 'motion';
  const compares = !isMotion || comparison.isOpen;
  return html`<div class="legend glass ${compares ? 'comparison' : ''} ${beside ? 'beside' : ''}">
    ${isMotion ? html`Motion between frames ${colorScale(player, '≥ ')}${rangeChoice(player)}` : nothing}
    ${compares ? comparisonPanel(player, acts) : nothing}
  </div>`;
}

/**
 * Writes frame, time and errors of the place that is shown. Rendering the template sixty times a second would cost more.
 *
 * @param isEdited whether the frame is shown with edits, or blended: what was measured is not what is shown then
 */
export function writeReadout(root: ParentNode, { capture, transport }: Player, isEdited: (frame: number) => boolean) {
  const write = (selector: string, text: string) => {
    const place = root.querySelector(selector);
    if (place && place.textContent !== text) place.textContent = text;
  };
  const last = Math.max(0, capture.frames - 1);
  const frame = Math.min(Math.floor(transport.position), last);
  const [first, number, end] = [0, frame, last].map((place) => numberAt(transport.numbers, place));
  write('[data-place]', `${numberText(number)} / ${numberText(end)}`);
  write('[data-clock]', clock((number - first) / transport.rate));
  const hidden = isEdited(frame);
  const figure = (value: number | undefined) =>
    value === undefined || !Number.isFinite(value) || hidden ? '–' : percent(value);
  write(
    '[data-score]',
    figure(capture.tracking?.scores[frame]) + (capture.tracking && isLost(capture.tracking, frame) ? ' lost' : ''),
  );
  write('[data-l2]', figure(capture.errors.l2[frame]));
  write('[data-linf]', figure(capture.errors.linf[frame]));
}
