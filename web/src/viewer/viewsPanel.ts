import { html, nothing } from 'lit';
import { HOME, type CameraState } from '../render/camera';
import { glyphs } from '../style/glyphs';
import { savedViews, saveViews } from './bookmarks';
import { numberAt, numberText } from './frameNumbers';
import type { Player } from './player';
import { viewFromText } from './viewState';

/** What the panel does with a viewer. */
export interface ViewsHost {
  /** The present view, as links have it. */
  readonly viewText: string;
  goTo(view: string): void;
  requestUpdate(): void;
  report(problem: string): void;
}

/** Angles of the camera along the axes of the scene, without perspective. */
const SIDES: readonly (readonly [string, Pick<CameraState, 'azimuth' | 'elevation'>])[] = [
  ['Front', { azimuth: 0, elevation: 0 }],
  ['Right', { azimuth: Math.PI / 2, elevation: 0 }],
  ['Top', { azimuth: 0, elevation: Math.PI / 2 - 0.01 }],
];

/** Orthographic views, and views that somebody saved. */
export function viewsPanel(player: Player, host: ViewsHost, close: () => void) {
  const { destination } = player.controls;
  const isFrom = ({ azimuth, elevation }: Pick<CameraState, 'azimuth' | 'elevation'>) =>
    destination.isParallel === true && destination.azimuth === azimuth && destination.elevation === elevation;
  const choice = (label: string, isChosen: boolean, choose: () => void) =>
    html`<button aria-pressed=${String(isChosen)} @click=${choose}>${label}</button>`;
  const views = savedViews(player.capture);
  const keep = (next: readonly string[]) => {
    if (!saveViews(player.capture, next)) host.report('This browser does not keep views. Copy the address instead.');
    host.requestUpdate();
  };
  return html`<aside class="panel glass" aria-label="Views">
    <header class="spread">
      <h2>Views</h2>
      <button class="quiet icon" title="Close" aria-label="Close" @click=${close}>${glyphs.close}</button>
    </header>
    <div class="segments" role="group" aria-label="Projection">
      ${choice('Perspective', !destination.isParallel, () => player.setParallel(false))}
      ${choice('Orthographic', destination.isParallel === true, () => player.setParallel(true))}
    </div>
    <div class="segments" role="group" aria-label="Orthographic views">
      ${SIDES.map(([label, from]) =>
        choice(label, isFrom(from), () => player.frameAll({ ...HOME, ...from, isParallel: true })),
      )}
    </div>
    <h2>Bookmarks</h2>
    ${views.length === 0 ? html`<p class="muted">Save camera, frame and layers to return to them.</p>` : nothing}
    <ul>
      ${views.map(
        (view, k) =>
          html`<li class="row">
            <button class="quiet grow" @click=${() => host.goTo(view)}>${k + 1}. ${nameOf(view, player)}</button>
            <button
              class="quiet icon"
              title="Remove"
              aria-label=${`Remove view ${k + 1}`}
              @click=${() => keep(views.filter((_, other) => other !== k))}
            >
              ${glyphs.trash}
            </button>
          </li>`,
      )}
    </ul>
    <button @click=${() => keep([...views, host.viewText])}>Save this view</button>
  </aside>`;
}

function nameOf(view: string, { transport }: Player): string {
  const { frame, camera } = viewFromText(view);
  const place = `Frame ${numberText(numberAt(transport.numbers, frame ?? 0))}`;
  return camera?.isParallel ? `${place}, orthographic` : place;
}
