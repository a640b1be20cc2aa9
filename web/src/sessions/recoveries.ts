import { LitElement, css, html, nothing } from 'lit';
import { customElement, state } from 'lit/decorators.js';
import type { Recovery } from '../service/messages';
import { patiently, Service } from '../service/service';
import { controls } from '../style/controls';
import { counted } from '../text';

const POLL_SECONDS = 5;

/** The newest recoveries of the service beside the page, kept up to date while the page is seen; nothing where there are none. */
@customElement('cager-recoveries')
export class Recoveries extends LitElement {
  static override styles = [
    controls,
    css`
      h2 {
        margin: var(--cager-space-5) 0 var(--cager-space-2);
      }
      li {
        display: flex;
        flex-wrap: wrap;
        gap: 0 var(--cager-space-3);
        padding: var(--cager-space-2) 0;
        border-top: 1px solid var(--cager-line);
      }
      a {
        font-weight: 600;
      }
    `,
  ];

  @state() private recoveries: readonly Recovery[] = [];
  private readonly service = new Service();
  private timer = 0;

  override connectedCallback() {
    super.connectedCallback();
    this.timer = window.setInterval(() => void this.look(), 1000 * POLL_SECONDS);
    void this.look();
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    clearInterval(this.timer);
  }

  override render() {
    if (this.recoveries.length === 0) return nothing;
    return html`<section aria-labelledby="recoveries">
      <h2 id="recoveries">Recoveries</h2>
      <ul>
        ${this.recoveries.map(
          (recovery) =>
            html`<li>
              <a href="#/recovery/${encodeURIComponent(recovery.id)}"
                >${recovery.name ?? `Recovery ${recovery.id.slice(-8)}`}</a
              >
              <span class="muted figures">${progressOf(recovery)}</span>
            </li>`,
        )}
      </ul>
    </section>`;
  }

  private async look() {
    if (document.hidden) return;
    try {
      const init = { cache: 'no-store', signal: patiently() } as const;
      this.recoveries = (await this.service.json<{ recoveries: Recovery[] }>('recoveries', init)).recoveries;
    } catch {
      // The list of sessions says what is wrong.
    }
  }
}

function progressOf({ state, frames }: Recovery): string {
  if (state === 'failed') return 'Failed';
  const followed = frames.followed === frames.received ? '' : `${frames.followed} of `;
  const parts = [
    state === 'completed' ? '' : state === 'ready' ? 'waiting for frames' : 'running',
    `${followed}${counted(frames.received, 'frame')}`,
    frames.lost > 0 ? `${frames.lost} lost` : '',
  ];
  return parts.filter(Boolean).join(' · ');
}
