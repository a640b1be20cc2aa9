import { html, type TemplateResult } from 'lit';
import type { LiveStatus } from '../capture';
import type { Player } from './player';
import { threeDigits } from '../text';
import { liveAgain, type Transport } from './transport';

/** What is shown counts as live while it is no more seconds than this behind the newest frame. */
const LIVE_SECONDS = 2;

/** Where the picture of a running session stands; `behind` and `retry` are seconds. `waiting`: the newest frame is shown, and none have come for some seconds. */
export type LivePlace =
  | { readonly kind: 'live' }
  | { readonly kind: 'waiting'; readonly missing: number | null }
  | { readonly kind: 'behind'; readonly behind: number }
  | { readonly kind: 'reconnecting'; readonly retry: number }
  | { readonly kind: 'signed-out' };

/** The place of a transport in a session that is followed; `now` as `Date.now()` tells it. */
export function livePlace(live: LiveStatus | null, transport: Transport, now: number): LivePlace {
  if (live?.state === 'signed-out') return { kind: 'signed-out' };
  if (live?.state === 'reconnecting')
    return { kind: 'reconnecting', retry: Math.max(0, Math.ceil(((live.retryAt ?? now) - now) / 1000)) };
  const frames = Math.max(0, transport.frames - 1 - transport.position) + (live?.behindFrames ?? 0);
  const behind = frames / transport.rate;
  if (live?.framesPerSecond === 0 && behind <= LIVE_SECONDS) return { kind: 'waiting', missing: live.missingFrame };
  return transport.playing && behind <= LIVE_SECONDS ? { kind: 'live' } : { kind: 'behind', behind };
}

export class LiveBadge {
  private shown = '';
  private timer = 0;

  constructor(private readonly host: HTMLElement & { requestUpdate(): void }) {}

  template(player: Player): TemplateResult {
    const place = livePlace(player.capture.live ?? null, player.transport, Date.now());
    const goLive = () => (player.transport = liveAgain(player.transport));
    const signIn = () => this.host.dispatchEvent(new CustomEvent('signin', { bubbles: true, composed: true }));
    this.stop();
    if (place.kind === 'reconnecting') this.timer = window.setTimeout(() => this.host.requestUpdate(), 1000);
    return liveBadge(place, goLive, signIn);
  }

  /** Renders anew when playing comes near the newest frame of a running session, or falls behind it. */
  follow({ capture, transport }: Player) {
    const place = capture.complete ? '' : livePlace(capture.live ?? null, transport, Date.now()).kind;
    if (place !== this.shown) this.host.requestUpdate();
    this.shown = place;
  }

  stop() {
    clearTimeout(this.timer);
  }
}

/** Says whether the picture is live, and what can be done where it is not. */
function liveBadge(place: LivePlace, goLive: () => void, signIn: () => void): TemplateResult {
  switch (place.kind) {
    case 'live':
      return html`<span class="live" role="status">LIVE</span>`;
    case 'waiting':
      return html`<span class="live behind" role="status"
        >${place.missing === null ? 'Waiting for frames' : `Waiting for frame ${place.missing}`}</span
      >`;
    case 'behind':
      return html`<button
        class="live behind"
        title="${threeDigits(place.behind)} s behind the newest frame"
        @click=${goLive}
      >
        Go live
      </button>`;
    case 'reconnecting':
      return html`<span class="live behind"
        >${place.retry > 0 ? `Reconnecting in ${place.retry} s` : 'Reconnecting'}</span
      >`;
    case 'signed-out':
      return html`<button class="live behind" @click=${signIn}>Sign in</button>`;
  }
}
