import { html, LitElement, nothing, type TemplateResult } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import { guard } from 'lit/directives/guard.js';
import { controls } from '../style/controls';
import { cages } from './comparison/cages';
import { claims, refused, summary } from './comparison/summary';
import { errors } from './comparison/errors';
import { random, swaps } from './comparison/handles';
import { noise } from './comparison/noise';
import { spectra, vectors } from './comparison/spectra';
import { systemsOf, type ComparisonReport, type SystemReport } from './comparison/system';
import { times } from './comparison/times';
import type { Report } from './data';
import { footer } from './table';
import { RestPose } from './geometry/modelInCage';
import { reportStyle } from './reportStyle';

type Content = (report: ComparisonReport, system: SystemReport) => TemplateResult;

/** Sections: address, name in the bar, title, and content. */
const SECTIONS: readonly (readonly [string, string, string, Content])[] = [
  ['errors', 'Errors', 'Errors of the reconstructed model', errors],
  ['cages', 'Cages', 'Stability of the cages', cages],
  ['spectra', 'Spectra', 'Spectra of the coordinate matrices', spectra],
  ['swaps', 'Maxvol', 'Maxvol, swap by swap', swaps],
  ['random', 'Random handles', 'Random handles against maxvol', random],
  ['noise', 'Noise', 'Noise on the capture', noise],
  ['vectors', 'Singular vectors', 'Singular vectors on the cage', vectors],
  ['times', 'Times', 'Times', times],
  ['claims', 'Claims', 'What the paper says, and what this capture says', claims],
];

/** The report of `cager compare`. */
@customElement('report-comparison')
export class ComparisonPage extends LitElement {
  static override styles = [controls, reportStyle];

  @property({ attribute: false }) report: (Report & { kind: 'comparison' }) | null = null;
  @state() private chosen = 0;
  private content: ComparisonReport | null = null;

  override willUpdate() {
    if (this.content || !this.report) return;
    const { figures, geometry } = this.report;
    this.content = { figures, geometry, rest: new RestPose(geometry), systems: systemsOf(figures, geometry) };
    document.title = `Comparison: ${figures.capture.source}`;
  }

  override render() {
    if (!this.content || !this.report) return nothing;
    const { content } = this;
    const system = content.systems[this.chosen];
    return html`
      <main>
        ${summary(content.figures)}
        <div class="bar">
          ${content.systems.length > 1 ? this.systemChoice(content.systems) : nothing}
          <nav aria-label="Sections">
            ${SECTIONS.map(([id, name]) => html`<a href="#${id}" @click=${(event: Event) => this.go(event, id)}>${name}</a>`)}
          </nav>
        </div>
        ${refused(content.figures)}
        ${SECTIONS.map(
          ([id, , title, section]) =>
            html`<section id=${id} aria-labelledby="${id}-title">
              <h2 id="${id}-title" tabindex="-1">
                ${title}${content.systems.length > 1 ? html` <span class="system">${system.name}</span>` : nothing}
              </h2>
              ${guard([system], () => section(content, system))}
            </section>`,
        )}
        ${footer(
          html`Written by <code>cager compare</code> ${this.report.program}. For the same inputs it writes the same
            figures; times differ. The paper: Thiery, Tierny and Boubekeur,
            <i>CageR: Cage-based Reverse Engineering of Animated 3D Shapes</i>, Computer Graphics Forum 31 (8), 2012.`,
        )}
      </main>
    `;
  }

  private systemChoice(systems: readonly SystemReport[]) {
    return html`<fieldset class="segments">
      <legend class="visually-hidden">Coordinates</legend>
      ${systems.map(
        ({ name }, k) =>
          html`<label>
            <input type="radio" name="system" .checked=${k === this.chosen} @change=${() => (this.chosen = k)} />${name}
          </label>`,
      )}
    </fieldset>`;
  }

  /** Sections are in a shadow tree, where links to them do not lead. */
  private go(event: Event, id: string) {
    event.preventDefault();
    const title = this.renderRoot.querySelector<HTMLElement>(`#${id}-title`);
    title?.scrollIntoView({ block: 'start' });
    title?.focus({ preventScroll: true });
  }
}
