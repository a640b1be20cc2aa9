import { css, html, LitElement, nothing, svg, type PropertyValues } from 'lit';
import { customElement, property } from 'lit/decorators.js';
import { picturePanelStyle } from '../style/picturePanel';
import { controls } from '../style/controls';
import { frameText } from '../viewer/frameNumbers';
import { iconButton } from '../style/parts';
import type { PoseView } from './poseView';
import { cornerOf } from './weights';

const REACH = 1.25;
/** How far a press of an arrow key moves the mark. */
const STEP = 0.05;
const WAYS: Readonly<Record<string, readonly [number, number]>> = {
  ArrowLeft: [-STEP, 0],
  ArrowRight: [STEP, 0],
  ArrowUp: [0, -STEP],
  ArrowDown: [0, STEP],
};

/**
 * Frames that are blended as poses, and where between them the model is: a slider for two, a pad for more.
 *
 * @fires leave when it is to be closed
 */
@customElement('cager-pose-panel')
export class PosePanel extends LitElement {
  static override styles = [
    controls,
    picturePanelStyle,
    css`
      input[type='range'] {
        display: block;
        width: 100%;
        height: 26px;
        margin: 0 0 4px;
      }
      input[type='range']:focus-visible {
        outline-offset: -1px;
      }
      p {
        margin-bottom: var(--cager-space-2);
      }
      svg.pad {
        display: block;
        width: min(100%, 200px);
        margin: 0 auto;
        cursor: crosshair;
        touch-action: none;
        border-radius: var(--cager-radius-small);
      }
      .pad polygon {
        fill: color-mix(in srgb, var(--cager-accent) 12%, transparent);
        stroke: var(--cager-muted);
        stroke-width: 0.01;
      }
      .pad circle {
        fill: var(--cager-accent);
      }
      .pad text {
        fill: var(--cager-text);
        font-size: 0.14px;
        text-anchor: middle;
        dominant-baseline: central;
      }
      @container (max-width: 680px) {
        .panel {
          align-self: flex-end;
        }
      }
    `,
  ];

  @property({ attribute: false }) view!: PoseView;
  private readonly follow = () => this.requestUpdate();

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.view.removeEventListener('change', this.follow);
  }

  protected override willUpdate(changed: PropertyValues) {
    if (!changed.has('view')) return;
    (changed.get('view') as PoseView | undefined)?.removeEventListener('change', this.follow);
    this.view.addEventListener('change', this.follow);
  }

  override render() {
    const { view } = this;
    const { poses, failure } = view;
    const weights = poses.length > 1 ? view.weights : [];
    return html`<section class="panel glass" aria-label="Blend poses" @keydown=${this.keepKey}>
      <header>
        <h2 class="grow">Blend poses</h2>
        ${iconButton('close', 'Close', () => this.dispatchEvent(new Event('leave')), 'Close (N)')}
      </header>
      <div class="body">
        ${failure !== null ? html`<p role="alert">${failure}</p>` : nothing}
        ${poses.length < 2 ? html`<p>Go to a frame and add it. Add two or more to blend them.</p>` : nothing}
        ${poses.length === 2 ? this.slider() : poses.length > 2 ? this.pad() : nothing}
        ${poses.map(
          (frame, k) =>
            html`<div class="row">
              <span class="grow">Frame ${this.numberOf(frame)}</span>
              <span class="figures muted">${k < weights.length ? `${Math.round(100 * weights[k])} %` : ''}</span>
              ${iconButton('close', `Remove frame ${this.numberOf(frame)}`, () => view.choose(poses.filter((other) => other !== frame)))}
            </div>`,
        )}
        <button @click=${this.add}>Add this frame</button>
      </div>
    </section>`;
  }

  private slider() {
    const { view } = this;
    return html`<input
      type="range"
      min="-0.25"
      max="1.25"
      step="0.01"
      .value=${String(view.place[0])}
      aria-label="Blend from the first pose to the second"
      @input=${(event: Event) => view.moveTo([Number((event.target as HTMLInputElement).value), 0])}
    />`;
  }

  private pad() {
    const { poses, place } = this.view;
    const corners = poses.map((_, k) => cornerOf(k, poses.length));
    return html`<svg
      class="pad"
      viewBox="${-REACH} ${-REACH} ${2 * REACH} ${2 * REACH}"
      tabindex="0"
      role="application"
      aria-label="Pose pad: arrow keys blend between the poses"
      @pointerdown=${this.point}
      @pointermove=${this.point}
    >
      <polygon points=${corners.map((corner) => corner.join(',')).join(' ')} />
      ${corners.map(([x, y], k) => svg`<text x=${1.13 * x} y=${1.13 * y}>${this.numberOf(poses[k])}</text>`)}
      <circle cx=${place[0]} cy=${place[1]} r="0.06" />
    </svg>`;
  }

  private numberOf(frame: number): string {
    return frameText(this.view.player.capture.frameNumbers, frame);
  }

  /** Takes the frame that is shown as a pose, once. */
  private readonly add = () => {
    const { player, poses } = this.view;
    const frame = Math.floor(player.transport.position);
    player.transport = { ...player.transport, playing: false };
    if (!poses.includes(frame)) this.view.choose([...poses, frame]);
  };

  private readonly point = (event: PointerEvent) => {
    const pad = event.currentTarget as SVGSVGElement;
    if (event.type === 'pointerdown') pad.setPointerCapture(event.pointerId);
    if (!pad.hasPointerCapture(event.pointerId)) return;
    const { left, top, width, height } = pad.getBoundingClientRect();
    const at = (part: number) => REACH * (2 * Math.min(1, Math.max(0, part)) - 1);
    this.view.moveTo([at((event.clientX - left) / width), at((event.clientY - top) / height)]);
  };

  /** Keys that a control of the panel takes are not for the player. */
  private readonly keepKey = (event: KeyboardEvent) => {
    const target = event.composedPath()[0] as Element;
    if (!event.key.startsWith('Arrow') || !/^(input|svg)$/i.test(target.tagName)) return;
    event.stopPropagation();
    if (!(target instanceof SVGSVGElement)) return;
    event.preventDefault();
    const [x, y] = WAYS[event.key];
    this.view.moveTo([this.view.place[0] + x, this.view.place[1] + y]);
  };
}
