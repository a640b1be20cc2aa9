import { html, nothing, type TemplateResult } from 'lit';
import type { FrameErrors } from '../capture';
import { HEAT } from '../render/colorMap';
import type { FrameRange } from '../editing/cageEdit';
import type { Layers } from '../render/drawn';
import { comparisonPanel, rangeChoice, type ComparisonActs } from './comparisonParts';
import { numberAt, numberText } from './frameNumbers';
import { glyphs, type GlyphName } from '../style/glyphs';
import type { Heat } from './heatMap';
import type { Player } from './player';
import { isLost } from './reports';
import { keyLabel, labelOf, SHORTCUTS, type Action } from './shortcuts';
import { count, percent } from '../text';
import './timeline';
import { sought, SPEEDS } from './transport';

export type Act = (action: Action) => void;

const HEAT_NAMES: Readonly<Record<Heat, string>> = {
  none: 'Heat map',
  motion: 'Heat map: motion',
  error: 'Heat map: error',
};

/** A button with a drawing; `pressed` makes it a switch. */
function tool(action: Action, name: GlyphName, act: Act, pressed?: boolean, label = labelOf(action)): TemplateResult {
  return html`<button
    class="quiet icon"
    data-action=${action}
    title="${label} (${keyLabel(action)})"
    aria-label=${label}
    aria-pressed=${pressed === undefined ? nothing : String(pressed)}
    @click=${() => act(action)}
  >
    ${glyphs[name]}
  </button>`;
}

/** Switches for what is drawn, and what to do with the picture. */
export function toolbar(
  player: Player,
  act: Act,
  shown: {
    colors: boolean;
    figures: boolean;
    editing: boolean;
    beside: boolean;
    poses: boolean;
    recording: boolean;
    recordable: boolean;
  },
) {
  const layers = Object.keys(player.layers) as (keyof Layers)[];
  const isPossible: Partial<Record<keyof Layers, boolean>> = {
    handles: player.capture.handles !== undefined,
    colors: shown.colors,
  };
  const possible = layers.filter((layer) => isPossible[layer] ?? true);
  return html`<div class="tools glass" role="toolbar" aria-label="View" aria-orientation="vertical">
    ${possible.map((layer) => tool(layer, layer, act, player.layers[layer]))}
    ${tool('heat', 'heat', act, player.heatMap.kind !== 'none', HEAT_NAMES[player.heatMap.kind])}
    ${tool('edit', 'edit', act, shown.editing)}
    ${player.capture.container ? tool('poses', 'poses', act, shown.poses) : nothing}
    ${tool('beside', 'beside', act, shown.beside)}
    <hr />
    ${tool('frame', 'frame', act)} ${tool('follow', 'follow', act, player.isFollowing)}
    ${tool('picture', 'camera', act)}
    ${
      shown.recordable
        ? tool('turntable', 'turntable', act, shown.recording, shown.recording ? 'Stop recording' : undefined)
        : nothing
    }
    ${tool('fullscreen', 'fullscreen', act)} ${tool('figures', 'figures', act, shown.figures)}
    ${tool('help', 'keyboard', act)}
  </div>`;
}

export function titleBox(heading: string, { capture }: Player, isEdited: boolean) {
  const { static: part, frames, tracking, frameNumbers } = capture;
  // Frames are counted from 0 unless they have numbers of their own: the place beside the timeline is one of these.
  const [first, last] = [0, Math.max(0, frames - 1)].map((frame) => numberText(numberAt(frameNumbers, frame)));
  const lost = tracking?.outcomes.filter((_, frame) => isLost(tracking, frame)).length ?? 0;
  return html`<div class="title glass">
    <h1 class="heading clip" title=${heading}>${heading}</h1>
    <p class="figures fine clip">
      ${count(part.rest.length / 3)} points, ${count(frames)} frames${frames > 1 ? ` (${first}–${last})` : nothing}<span
        class="more"
        >, cage of ${count(part.cage.positions.length / 3)} vertices</span
      >${lost > 0 ? html`, <span class="lost">${count(lost)} lost</span>` : nothing}${isEdited ? ', edited' : nothing}
    </p>
  </div>`;
}

/** What the timeline shows beside the capture's own errors: those of a second capture, the range of an edit. */
interface TimelineParts {
  readonly besideErrors: FrameErrors | null;
  readonly range: FrameRange | null;
}

export function deck(player: Player, act: Act, { besideErrors, range }: TimelineParts) {
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
      .position=${transport.position}
      @seek=${(event: CustomEvent<number>) => (player.transport = sought(player.transport, event.detail))}
    ></cager-timeline>
  </div>`;
}

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
    ${tool('previous', 'previous', act)} ${tool('next', 'next', act)} ${tool('loop', 'loop', act, transport.loop)}
    ${figures ? tool('worst', 'worst', act) : nothing}
    <select
      class="figures"
      aria-label="Speed"
      title="Speed"
      @change=${(event: Event) => onSpeed(Number((event.target as HTMLSelectElement).value))}
    >
      ${SPEEDS.map((speed) => html`<option value=${speed} .selected=${speed === transport.speed}>${speed}×</option>`)}
    </select>
    <div class="place row figures"><span data-place></span><span class="clock muted" data-clock></span></div>
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
    ${
      isMotion
        ? html`Motion between frames
            <div class="bar" .style=${`background: ${HEAT.gradient}`}></div>
            <div class="spread muted figures">
              <span>0</span><span>${percent(heatMap.largest)} of the diagonal and above</span>
            </div>
            ${rangeChoice(player)}`
        : nothing
    }
    ${compares ? comparisonPanel(player, acts) : nothing}
  </div>`;
}

export function helpSheet(close: () => void) {
  return html`<dialog
    class="sheet"
    aria-labelledby="help-title"
    @click=${(event: Event) => event.target === event.currentTarget && close()}
  >
    <header>
      <h2 id="help-title">Keyboard shortcuts</h2>
      <button class="quiet icon" aria-label="Close" @click=${close}>${glyphs.close}</button>
    </header>
    <div class="columns">
      ${SHORTCUTS.map(
        ({ title, entries }) =>
          html`<section>
            <h3 class="fine">${title}</h3>
            <dl class="keys">
              ${entries.map(
                ({ action, label }) =>
                  html`<dt><kbd>${keyLabel(action)}</kbd></dt>
                    <dd>${label}</dd>`,
              )}
            </dl>
          </section>`,
      )}
    </div>
    <p class="muted">
      Drag to orbit; drag with the right button or two fingers to pan; scroll or pinch to zoom; double-click to frame
      all.
    </p>
  </dialog>`;
}
