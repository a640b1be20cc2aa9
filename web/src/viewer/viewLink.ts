import type { UpAxis } from '../capture';
import type { Player } from './player';
import { sought } from './transport';
import { usualUp } from './upright';
import { viewFromText, viewText, type ViewState } from './viewState';

/** How long the view must rest before it is told to whoever keeps links. */
const REST_MILLISECONDS = 300;

export class ViewLink {
  /** The axis that points up of the capture beside, where a link or somebody chose it. */
  besideUp: UpAxis | null = null;
  private timer = 0;

  /** @param onRest called when the view has rested for a while */
  constructor(private readonly onRest: () => void) {}

  /** Goes to a view; one that names a frame stands there. */
  show(view: ViewState, player: Player, atOnce: boolean) {
    this.besideUp = view.besideUp;
    player.layers = view.layers;
    if (player.heatMap.kind !== view.heat) player.setHeat(view.heat);
    player.setUp(view.up ?? usualUp(player.capture.static));
    player.chooseFollowing(view.follow);
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
      up: player.up === usualUp(player.capture.static) ? null : player.up,
      besideUp: this.besideUp,
      // A camera that is not the usual one stands beside a model that is followed.
      follow: player.followChoice ?? (player.isFollowing && !player.isHome ? true : null),
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
