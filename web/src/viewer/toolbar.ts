import { html, nothing, type TemplateResult } from 'lit';
import type { UpAxis } from '../capture';
import type { Layers } from '../render/drawn';
import { glyphs, type GlyphName } from '../style/glyphs';
import type { Heat } from './heatMap';
import type { Player } from './player';
import { keyLabel, labelOf, type Action } from './shortcuts';

export type Act = (action: Action) => void;

const HEAT_NAMES: Readonly<Record<Heat, string>> = {
  none: 'Heat map',
  motion: 'Heat map: motion',
  error: 'Heat map: error',
};

/** What is written below a drawing where there is room, of actions with longer labels. */
const CAPTIONS: Partial<Record<Action, string>> = {
  handles: 'Handles',
  heat: 'Heat map',
  follow: 'Follow',
  beside: 'Compare',
  fullscreen: 'Full screen',
  poses: 'Blend poses',
  picture: 'Image',
  turntable: 'Turntable',
};

/** A button with a drawing; `pressed` makes it a switch. */
export function tool(action: Action, name: GlyphName, act: Act, pressed?: boolean, label = labelOf(action)) {
  return html`<button
    class="quiet icon"
    data-action=${action}
    title="${label} (${keyLabel(action)})"
    aria-label=${label}
    aria-pressed=${pressed === undefined ? nothing : String(pressed)}
    @click=${() => act(action)}
  >
    ${glyphs[name]}<span class="caption-text" aria-hidden="true">${CAPTIONS[action] ?? label}</span>
  </button>`;
}

/** Says which axis of a capture points up, and has the other one do so. */
export function upButton(up: UpAxis, choose: (up: UpAxis) => void) {
  const other = up === 'y' ? 'z' : 'y';
  return html`<button
    class="up"
    title=${`Up axis: ${up.toUpperCase()}. Click for ${other.toUpperCase()} (${keyLabel('up')})`}
    aria-label=${`Up: ${up.toUpperCase()}`}
    @click=${() => choose(other)}
  >
    <span>Up: </span>${up.toUpperCase()}
  </button>`;
}

export interface Tools {
  readonly colors: boolean;
  readonly materials: boolean;
  /** Whether the panel of parts is open; null where there are none to choose among. */
  readonly parts: boolean | null;
  readonly figures: boolean;
  readonly views: boolean;
  readonly editing: boolean;
  readonly beside: boolean;
  readonly poses: boolean;
  readonly recording: boolean;
  readonly exports: boolean;
  /** Whether its address leads back here. */
  readonly linkable: boolean;
}

/** Switches for what is drawn, and what to do with the picture, in groups. */
export function toolbar(player: Player, act: Act, shown: Tools) {
  const isPossible: Partial<Record<keyof Layers, boolean>> = {
    handles: player.capture.handles !== undefined,
    colors: shown.colors,
    materials: shown.materials,
  };
  const layers = (Object.keys(player.layers) as (keyof Layers)[]).filter((layer) => isPossible[layer] ?? true);
  const record = shown.recording ? 'Stop recording' : undefined;
  return html`<div class="tools glass scrolls" role="toolbar" aria-label="View" aria-orientation="vertical">
    ${group('Show', [
      ...layers.map((layer) => tool(layer, layer, act, player.layers[layer])),
      tool('heat', 'heat', act, player.heatMap.kind !== 'none', HEAT_NAMES[player.heatMap.kind]),
    ])}
    ${group('Inspect', [
      shown.parts === null ? nothing : tool('parts', 'parts', act, shown.parts),
      tool('figures', 'figures', act, shown.figures),
      tool('beside', 'beside', act, shown.beside),
      tool('frame', 'frame', act),
      tool('follow', 'follow', act, player.isFollowing),
      tool('views', 'views', act, shown.views),
      tool('fullscreen', 'fullscreen', act),
    ])}
    ${group('Edit', [
      tool('edit', 'edit', act, shown.editing),
      player.capture.container ? tool('poses', 'poses', act, shown.poses) : nothing,
    ])}
    ${group('Export', [
      tool('export', 'download', act, shown.exports),
      tool('picture', 'camera', act),
      tool('turntable', 'turntable', act, shown.recording, record),
      shown.linkable ? tool('link', 'link', act) : nothing,
    ])}
    ${group('Learn', [tool('help', 'help', act)])}
  </div>`;
}

function group(name: string, tools: readonly (TemplateResult | typeof nothing)[]) {
  return html`<div role="group" aria-label=${name}><span class="fine" aria-hidden="true">${name}</span>${tools}</div>`;
}
