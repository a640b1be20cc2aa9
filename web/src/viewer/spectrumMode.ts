import { html, nothing } from 'lit';
import type { SpectrumView } from '../spectrum/spectrumView';
import type { Player } from './player';

/** What showing singular vectors, or shapes between frames, needs of the viewer around it. */
export interface SpectrumHost {
  readonly player: Player | null;
  requestUpdate(): void;
  report(problem: string): void;
}

/** Singular values and vectors of Φ in a viewer: loads what shows them when it is first used. */
export class SpectrumMode {
  isOn = false;
  view: SpectrumView | null = null;

  constructor(private readonly host: SpectrumHost) {}

  /** Part of a narrow picture's height that the panel takes, as its style says. */
  get panelShare(): number {
    return this.isOn ? 0.38 : 0;
  }

  async toggle() {
    const { player } = this.host;
    if (!player) return;
    if (this.isOn) {
      this.leave();
      return;
    }
    try {
      const { SpectrumView } = await import('../spectrum');
      if (this.host.player !== player) return;
      if (this.view) this.view.show();
      else this.view = new SpectrumView(player);
    } catch {
      this.host.report('This part of the page could not be loaded; reload it when the service answers again.');
      return;
    }
    this.isOn = true;
    this.host.requestUpdate();
  }

  panel(look: number) {
    if (!this.isOn || !this.view) return nothing;
    return html`<cager-spectrum-panel
      .view=${this.view}
      .look=${look}
      @leave=${() => this.leave()}
    ></cager-spectrum-panel>`;
  }

  /** Chooses the vector before or after with the arrow keys up and down; whether the key was for that. */
  pressKey(event: KeyboardEvent): boolean {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!this.isOn || !this.view || step === undefined || event.ctrlKey || event.altKey || event.metaKey) return false;
    if (/^(INPUT|SELECT)$/.test((event.composedPath()[0] as HTMLElement).tagName)) return false;
    event.preventDefault();
    this.view.index += step;
    return true;
  }

  leave() {
    this.isOn = false;
    this.view?.hide();
    this.host.requestUpdate();
  }

  /** Forgets the capture. */
  close() {
    this.view?.dispose();
    this.view = null;
    this.isOn = false;
  }
}
