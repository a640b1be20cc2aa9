import { html, nothing } from 'lit';
import type { PoseView } from '../poses';
import type { ViewerHost } from './host';

/** Shapes between frames in a viewer: loads what shows them when it is first used. */
export class PoseMode {
  isOn = false;
  private view: PoseView | null = null;

  constructor(private readonly host: ViewerHost) {}

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
      const { PoseView } = await import('../poses');
      if (this.host.player !== player) return;
      this.view ??= new PoseView(player);
      this.view.moveTo(this.view.place);
    } catch {
      this.host.report('This part of the page could not be loaded. Check your connection and reload.');
      return;
    }
    this.isOn = true;
    this.host.requestUpdate();
  }

  panel() {
    if (!this.isOn || !this.view) return nothing;
    return html`<cager-pose-panel .view=${this.view} @leave=${() => this.leave()}></cager-pose-panel>`;
  }

  leave() {
    this.isOn = false;
    this.view?.hide();
    this.host.requestUpdate();
  }

  close() {
    this.view?.dispose();
    this.view = null;
    this.isOn = false;
  }
}
