import { css, html, LitElement } from 'lit';
import { customElement, property } from 'lit/decorators.js';
import { controls } from '../style/controls';
import { counted } from '../text';
import type { KeptEdits } from './keptEdits';

/**
 * Says that a capture has edits from before.
 *
 * @fires takeup when they are to be there again
 * @fires throwaway when they are to be forgotten
 */
@customElement('cager-kept-offer')
export class KeptOffer extends LitElement {
  static override styles = [
    controls,
    css`
      :host {
        position: absolute;
        z-index: 3;
        top: var(--cager-space-3);
        left: 50%;
        translate: -50% 0;
        display: flex;
        flex-wrap: wrap;
        align-items: center;
        justify-content: center;
        gap: var(--cager-space-2) var(--cager-space-3);
        width: max-content;
        max-width: min(460px, calc(100% - 2 * 90px));
        padding: var(--cager-space-2) var(--cager-space-3);
        border: 1px solid color-mix(in srgb, var(--cager-accent) 60%, transparent);
        border-radius: var(--cager-radius-large);
        background: var(--cager-surface);
        box-shadow: var(--cager-shadow);
      }
      p {
        flex: 1 1 220px;
      }
      @container (max-width: 1000px) {
        :host {
          top: calc(var(--cager-space-3) + 64px);
        }
      }
      @container (max-width: 680px) {
        :host {
          left: var(--cager-space-2);
          max-width: calc(100% - 2 * var(--cager-space-2) - 62px);
          translate: none;
        }
      }
    `,
  ];

  @property({ attribute: false }) kept!: KeptEdits;

  override render() {
    const { edits, changed } = this.kept;
    const when = new Date(changed).toLocaleString(undefined, { dateStyle: 'medium', timeStyle: 'short' });
    return html`
      <p role="status">${counted(edits.length, 'edit')} kept in this browser, from ${when}</p>
      <div class="row">
        <button class="primary" @click=${() => this.dispatchEvent(new Event('takeup'))}>Restore</button>
        <button @click=${() => this.dispatchEvent(new Event('throwaway'))}>Discard</button>
      </div>
    `;
  }
}
