import { html, LitElement, nothing, unsafeCSS, type PropertyValues } from 'lit';
import { customElement, property, query } from 'lit/decorators.js';
import type uPlot from 'uplot';
import uPlotStyle from 'uplot/dist/uPlot.min.css?inline';
import { picturePanelStyle } from '../style/picturePanel';
import { controls } from '../style/tokens';
import { glyph } from '../viewer/glyphs';
import { grouped, threeDigits } from '../viewer/text';
import { resolvedColor } from '../style/resolvedColor';
import { spectrumChart } from './chart';
import { signedGradient } from '../render/colorMap';
import type { Spectrum } from './singular';
import { spectrumPanelStyle } from './spectrumPanelStyle';
import type { SpectrumView } from './spectrumView';

const AXES = ['x', 'y', 'z'] as const;

/**
 * Singular values of Φ as a chart, and which of its right singular vectors is painted on the cage.
 *
 * @fires leave when it is to be closed
 */
@customElement('cager-spectrum-panel')
export class SpectrumPanel extends LitElement {
  static override styles = [controls, unsafeCSS(uPlotStyle), picturePanelStyle, spectrumPanelStyle];

  @property({ attribute: false }) view!: SpectrumView;
  /** Changes when colours do: the chart is drawn anew. */
  @property({ type: Number }) look = 0;
  @query('.chart') private readonly place!: HTMLElement | null;
  private chart: uPlot | null = null;
  private charted: Spectrum | null = null;
  private readonly sizes = new ResizeObserver(() => this.resize());
  private readonly follow = () => this.requestUpdate();

  override connectedCallback() {
    super.connectedCallback();
    this.sizes.observe(this);
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.sizes.disconnect();
    this.view.removeEventListener('change', this.follow);
    this.chart?.destroy();
    this.chart = null;
  }

  protected override willUpdate(changed: PropertyValues) {
    if (!changed.has('view')) return;
    (changed.get('view') as SpectrumView | undefined)?.removeEventListener('change', this.follow);
    this.view.addEventListener('change', this.follow);
  }

  protected override updated(changed: PropertyValues) {
    const { spectrum } = this.view;
    if (!this.place || !spectrum) return;
    if (!this.chart || this.charted !== spectrum || changed.has('look')) this.draw(spectrum);
    else this.chart.redraw(false);
  }

  override render() {
    const { spectrum, failure, progress } = this.view;
    return html`<section class="panel" aria-label="Singular values" @keydown=${this.keepKey}>
      <header>
        <h2>Singular values of Φ</h2>
        <button
          class="quiet icon"
          title="Close (V)"
          aria-label="Close"
          @click=${() => this.dispatchEvent(new Event('leave'))}
        >
          ${glyph('close')}
        </button>
      </header>
      <div class="body">
        ${
          failure !== null
            ? html`<p role="alert">${failure}</p>`
            : spectrum
              ? this.found(spectrum)
              : html`<p role="status">Computing singular values, ${Math.round(100 * progress)} %</p>`
        }
      </div>
    </section>`;
  }

  private found(spectrum: Spectrum) {
    const { view } = this;
    const { values } = spectrum;
    const { system } = view.player.capture.static;
    const value = values[view.index];
    const choose = (event: Event) => (view.index = Number((event.target as HTMLInputElement).value) - 1);
    return html`
      <div class="chart" @pointerdown=${this.point} @pointermove=${this.point}></div>
      <input
        type="range"
        min="1"
        max=${values.length}
        step="1"
        .value=${String(view.index + 1)}
        aria-label="Singular vector"
        aria-valuetext=${`${view.index + 1} of ${values.length}, singular value ${threeDigits(value)}`}
        @input=${choose}
      />
      <p class="figures value">
        <strong>σ<sub>${view.index + 1}</sub> = ${threeDigits(value)}</strong>
        <span class="muted">${threeDigits(value / values[0])} of the largest</span>
      </p>
      <div class="bar" .style=${`background: ${signedGradient()}`}></div>
      <div class="ends figures"><span>−</span><span>0</span><span>+</span></div>
      ${
        system === 'green-free'
          ? html`<div class="segments" role="group" aria-label="What is painted">
              ${this.choice('Vertices', view.part === 'vertices', () => view.showPart('vertices'))}
              ${this.choice('Normals of faces', view.part === 'faces', () => view.showPart('faces'))}
            </div>`
          : nothing
      }
      <div class="segments" role="group" aria-label="Move the cage by it along">
        <span>Move along</span>
        ${AXES.map((name, axis) =>
          this.choice(
            name,
            view.motion === axis,
            () => (view.motion = view.motion === axis ? null : (axis as 0 | 1 | 2)),
          ),
        )}
      </div>
      ${this.figures(spectrum)}
    `;
  }

  private figures({ values, points }: Spectrum) {
    const { report, rest, spectrum: regularised } = this.view.player.capture.static;
    const rank = Number(report?.rank);
    const row = (label: string, value: string) =>
      html`<dt>${label}</dt>
        <dd>${value}</dd>`;
    return html`<dl class="figures">
        ${row('Largest over smallest', threeDigits(values[0] / values[values.length - 1]))}
        ${Number.isInteger(rank) && rank > 0 ? row('Rank that the encoding found', `${rank} of ${values.length}`) : nothing}
        ${
          regularised !== undefined && regularised > 0
            ? row('Directions kept near the rest cage', `the last ${Math.min(regularised, values.length)}`)
            : nothing
        }
        ${points < rest.length / 3 ? row('Points read', `${grouped(points)} of ${grouped(rest.length / 3)}`) : nothing}
      </dl>
      <p class="muted">
        Vertices of one colour move together. Moves of the first vectors move the model, those of the last ones hardly
        do.
      </p>`;
  }

  private choice(label: string, isChosen: boolean, choose: () => void) {
    return html`<button aria-pressed=${String(isChosen)} @click=${choose}>${label}</button>`;
  }

  /** Chooses the value that is pointed at. */
  private readonly point = (event: PointerEvent) => {
    if (!this.chart || (event.type === 'pointermove' && (event.buttons & 1) === 0)) return;
    const { left } = this.chart.over.getBoundingClientRect();
    this.view.index = this.chart.posToVal(event.clientX - left, 'x') - 1;
  };

  /** Keys that a control of the panel takes are not for the player. */
  private readonly keepKey = (event: KeyboardEvent) => {
    if (/^(Arrow|Page|Home|End)/.test(event.key) && event.composedPath()[0] instanceof HTMLInputElement) {
      event.stopPropagation();
    }
  };

  private draw(spectrum: Spectrum) {
    this.chart?.destroy();
    const style = getComputedStyle(this);
    const color = (name: string) => resolvedColor(this.renderRoot, style.getPropertyValue(`--cager-${name}`));
    const look = {
      line: color('line'),
      values: color('accent'),
      chosen: color('cage'),
      text: color('muted'),
      font: `11px ${style.getPropertyValue('--cager-font')}`,
    };
    const { view } = this;
    const count = spectrum.values.length;
    const marks = () => ({
      chosen: view.index,
      regularised: count - Math.min(count, view.player.capture.static.spectrum ?? 0),
    });
    this.chart = spectrumChart(this.place!, spectrum.values, marks, look);
    this.charted = spectrum;
  }

  private resize() {
    if (this.chart && this.place && this.place.clientWidth > 0) {
      this.chart.setSize({ width: this.place.clientWidth, height: this.place.clientHeight });
    }
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'cager-spectrum-panel': SpectrumPanel;
  }
}
