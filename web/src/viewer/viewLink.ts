import type { Player } from './player';
import { sought } from './transport';
import { viewFromText, viewText, type ViewState } from './viewState';

/** How long the view must rest before it is told to whoever keeps links. */
const REST_MILLISECONDS = 300;

export class ViewLink {
  up: 'y' | 'z' = 'y';
  private timer = 0;

  /** @param onRest called when the view has rested for a while */
  constructor(private readonly onRest: () => void) {}

  /** Goes to a view; one that names a frame stands there. */
  show(view: ViewState, player: Player, atOnce: boolean) {
    this.up = view.up;
    player.layers = view.layers;
    if (player.heatMap.kind !== view.heat) player.setHeat(view.heat);
    player.setUp(view.up);
    player.isFollowing = view.follow;
    if (view.frame !== null) player.transport = { ...sought(player.transport, view.frame), playing: false };
    if (view.camera) player.controls.go(view.camera, atOnce);
    else player.goHome(atOnce);
  }

  /** Goes to a view that is given as text while the player is open. */
  goTo(text: string, player: Player) {
    const view = viewFromText(text);
    this.show(view, player, false);
    // A link without a frame is of the first one, or of a capture that plays.
    if (view.frame === null && !player.transport.playing) player.transport = sought(player.transport, 0);
  }

  textOf(player: Player): string {
    const { playing, position } = player.transport;
    const frame = Math.floor(position);
    return viewText({
      frame: playing || frame === 0 ? null : frame,
      // The usual camera is that of the capture, which no link needs to name.
      camera: player.isHome ? null : player.controls.destination,
      up: this.up,
      follow: player.isFollowing,
      layers: player.layers,
      heat: player.heatMap.kind,
    });
  }

  /** To be called after every picture. */
  touch() {
    clearTimeout(this.timer);
    this.timer = window.setTimeout(this.onRest, REST_MILLISECONDS);
  }

  stop() {
    clearTimeout(this.timer);
  }
}
