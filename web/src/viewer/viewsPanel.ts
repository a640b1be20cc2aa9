import { html, nothing } from 'lit';
import { HOME, type CameraState } from '../render/camera';
import { iconButton, segments } from '../style/parts';
import { frameText } from './frameNumbers';
import type { Player } from './player';
import { viewFromText } from './viewState';
import type { Capture } from '../capture';
import { guarded } from '../service/token';
import type { ViewerHost } from './host';

type Side = Pick<CameraState, 'azimuth' | 'elevation'>;

/** Angles of the camera along the axes of the scene, without perspective. */
const SIDES: readonly (readonly [Side, string])[] = [
  [{ azimuth: 0, elevation: 0 }, 'Front'],
  [{ azimuth: Math.PI / 2, elevation: 0 }, 'Right'],
  [{ azimuth: 0, elevation: Math.PI / 2 - 0.01 }, 'Top'],
];
const PROJECTIONS = [
  [false, 'Perspective'],
  [true, 'Orthographic'],
] as const;

export function viewsPanel(player: Player, host: ViewerHost, close: () => void) {
  const { destination } = player.controls;
  const isFrom = ({ azimuth, elevation }: Side) =>
    destination.isParallel === true && destination.azimuth === azimuth && destination.elevation === elevation;
  const side = SIDES.map(([from]) => from).find(isFrom);
  const views = savedViews(player.capture);
  const keep = (next: readonly string[]) => {
    if (!saveViews(player.capture, next)) host.report('This browser does not keep views. Copy the address instead.');
    host.requestUpdate();
  };
  return html`<aside class="panel glass" aria-label="Views">
    <header class="spread">
      <h2>Views</h2>
      ${iconButton('close', 'Close', close)}
    </header>
    ${segments('Projection', PROJECTIONS, destination.isParallel === true, (isParallel) => player.setParallel(isParallel))}
    ${segments('Orthographic views', SIDES, side, (from) => player.frameAll({ ...HOME, ...from, isParallel: true }))}
    <h2>Bookmarks</h2>
    ${views.length === 0 ? html`<p class="muted">Save camera, frame and layers to return to them.</p>` : nothing}
    <ul>
      ${views.map(
        (view, k) =>
          html`<li class="row">
            <button class="quiet grow" @click=${() => host.goTo(view)}>${k + 1}. ${nameOf(view, player)}</button>
            ${iconButton('trash', `Remove view ${k + 1}`, () => keep(views.filter((_, other) => other !== k)), 'Remove')}
          </li>`,
      )}
    </ul>
    <button @click=${() => keep([...views, host.viewText])}>Save this view</button>
  </aside>`;
}

function nameOf(view: string, { transport }: Player): string {
  const { frame, camera } = viewFromText(view);
  const place = `Frame ${frameText(transport.numbers, frame ?? 0)}`;
  return camera?.isParallel ? `${place}, orthographic` : place;
}

const PREFIX = 'cager-views ';
const MAX_VIEWS = 20;

/** Views as text, as links have them. */
function savedViews(capture: Capture): readonly string[] {
  const found = guarded(() => JSON.parse(localStorage.getItem(keyOf(capture)) ?? '[]') as unknown);
  return Array.isArray(found) ? found.filter((view) => typeof view === 'string').slice(0, MAX_VIEWS) : [];
}

/** Returns whether the browser keeps them. */
function saveViews(capture: Capture, views: readonly string[]): boolean {
  const name = keyOf(capture);
  const isKept = guarded(() => {
    if (views.length === 0) localStorage.removeItem(name);
    else localStorage.setItem(name, JSON.stringify(views.slice(-MAX_VIEWS)));
    return true;
  });
  return isKept ?? false;
}

function keyOf({ identity, name }: Capture): string {
  return `${PREFIX}${identity ?? `file ${name}`}`;
}
