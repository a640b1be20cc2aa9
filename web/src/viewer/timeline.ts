import { html, LitElement } from 'lit';
import { customElement, property, query } from 'lit/decorators.js';
import { axisOf } from '../charts/axis';
import { plot, plotStyle, thinned, type Series } from '../charts/plot';
import type { FrameErrors, Tracking } from '../capture';
import type { FrameRange } from '../editing/cageEdit';
import { numberAt, numberText, placeOf, type FrameNumbers } from './frameNumbers';
import { isLost, lostRuns } from './reports';
import { percent } from '../text';
import { timelineStyle } from './timelineStyle';
import { controls } from '../style/controls';

/** Space beside the chart for half a thumb, and on its left for labels. */
const [MARGIN, GUTTER] = [12, 58];
/** Places along the chart; frames that share one are shown by the worst of them. */
const COLUMNS = 600;

/**
 * The timeline: a bar to scrub on and, where errors are known, their chart above it.
 *
 * @fires seek with the frame, a whole number, that was pointed at
 */
@customElement('cager-timeline')
export class Timeline extends LitElement {
  static override styles = [controls, plotStyle, timelineStyle];

  @property({ type: Number }) frames = 0;
  @property({ attribute: false }) errors: FrameErrors | null = null;
  /** Errors of a capture that is shown beside this one, at the frames of this one. */
  @property({ attribute: false }) besideErrors: FrameErrors | null = null;
  /** How frames were found, of a recovery: its scores are charted in place of errors, and lost frames are marked. */
  @property({ attribute: false }) tracking: Tracking | undefined;
  /** Numbers of the frames where they come from, if these are others. */
  @property({ attribute: false }) frameNumbers: FrameNumbers = null;
  /** Tells frames that are shown with edits: what was measured is not what is shown then. */
  @property({ attribute: false }) edited: ((frame: number) => boolean) | null = null;
  /** Frames that an edit is kept over, shown below to be dragged. */
  @property({ attribute: false }) range: FrameRange | null = null;
  /** First and last frame that are played; null for all. */
  @property({ attribute: false }) played: readonly [number, number] | null = null;
  @query('.chart') private readonly chartPlace!: HTMLElement | null;
  @query('.slider') private readonly slider!: HTMLElement;
  private place = 0;
  private hovered: number | null = null;
  private readonly sizes = new ResizeObserver(() => this.placeTrack());

  /** The place in the capture that is shown, between two frames too. */
  get position(): number {
    return this.place;
  }

  set position(position: number) {
    this.place = position;
    // Sixty times a second: not worth a render of the template.
    if (this.hasUpdated) this.movePlace();
  }

  private get frame(): number {
    return Math.max(0, Math.min(this.frames - 1, Math.round(this.place)));
  }

  override render() {
    const measured = this.isMeasured();
    return html`
      <div
        class="slider"
        role="slider"
        tabindex="0"
        aria-label="Frame"
        aria-valuemin=${this.numberOf(0)}
        aria-valuemax=${this.numberOf(this.frames - 1)}
        aria-valuenow=${this.numberOf(this.frame)}
        @pointerdown=${this.grab}
        @pointermove=${this.move}
        @pointerleave=${this.leave}
      >
        ${measured ? html`<div class="chart">${this.chart()}</div>` : null}
        <div class="needle" ?hidden=${!measured}></div>
        <div class="hover" hidden></div>
        <div class="tip figures" hidden></div>
        <div class="track">
          <div class="rail"></div>
          ${this.tracking ? lostRuns(this.tracking).map((run) => this.mark(run)) : null}
          ${this.played ? this.outside(this.played) : null}
          <div class="done"></div>
          <div class="thumb"></div>
        </div>
      </div>
      ${
        this.range
          ? html`<cager-range-strip
              .range=${this.range}
              .frames=${this.frames}
              .frameNumbers=${this.frameNumbers}
              .shareOf=${(frame: number) => this.shareOf(frame)}
              .frameAt=${(event: PointerEvent) => this.frameAt(event)}
            ></cager-range-strip>`
          : null
      }
    `;
  }

  override connectedCallback() {
    super.connectedCallback();
    this.sizes.observe(this);
  }

  override disconnectedCallback() {
    super.disconnectedCallback();
    this.sizes.disconnect();
  }

  protected override updated() {
    this.placeTrack();
  }

  private mark([first, last]: [number, number]) {
    const [left, right] = [this.shareOf(first), this.shareOf(last)];
    return html`<i class="lost" .style=${`left: ${100 * left}%; width: ${100 * (right - left)}%`}></i>`;
  }

  /** What of the rail is not played. */
  private outside([first, last]: readonly [number, number]) {
    const [left, right] = [this.shareOf(first), this.shareOf(last)];
    return html`<i class="outside" .style=${`left: 0; width: ${100 * left}%`}></i
      ><i class="outside" .style=${`left: ${100 * right}%; right: 0`}></i>`;
  }

  private isMeasured(): boolean {
    if (this.tracking) return this.frames > 1;
    const isKnown = (errors: FrameErrors | null) => errors?.linf.some(Number.isFinite) ?? false;
    return this.frames > 1 && (isKnown(this.errors) || isKnown(this.besideErrors));
  }

  /** L∞ and L2 of all frames, then those of a second capture, dashed. */
  private chart() {
    const { errors, besideErrors, tracking, edited } = this;
    const own = (values: Float32Array | undefined) =>
      edited ? values?.map((value, frame) => (edited(frame) ? NaN : value)) : values;
    const lines: [string, Series['mark'], Float32Array | undefined][] = [
      ['cage', 'line', tracking ? undefined : errors?.linf],
      ['accent', 'line', tracking?.scores ?? errors?.l2],
      ['cage', 'dashes', besideErrors?.linf],
      ['accent', 'dashes', besideErrors?.l2],
    ];
    // The scale stays while frames are edited.
    const top = lines.reduce((most, [, , values]) => values?.reduce((a, b) => (b > a ? b : a), most) ?? most, 1e-9);
    const series = lines.map(([color, mark, values]): Series => {
      const shown = mark === 'line' ? own(values) : values;
      const points = thinned(shown ?? [], (frame) => this.shareOf(frame), COLUMNS);
      return { label: '', color: `var(--cager-${color})`, mark, points };
    });
    return plot({ x: axisOf([0, 1], 0), y: axisOf([0, 1.08 * top], 2), series, text: percent });
  }

  private placeTrack() {
    for (const { style } of this.renderRoot.querySelectorAll<HTMLElement>('.chart, .track, cager-range-strip')) {
      style.marginLeft = `${this.left()}px`;
      style.marginRight = `${MARGIN}px`;
    }
    this.movePlace();
  }

  private left(): number {
    return this.chartPlace?.clientHeight ? GUTTER : MARGIN;
  }

  /** Where a place is between the first frame and the last one, by their numbers. */
  private shareOf(place: number): number {
    const [first, at, last] = [0, place, this.frames - 1].map((k) => this.numberOf(k));
    return last > first ? Math.min(1, (at - first) / (last - first)) : 0;
  }

  private numberOf(place: number): number {
    return numberAt(this.frameNumbers, Math.max(0, place));
  }

  private movePlace() {
    const share = this.shareOf(this.place);
    const width = this.clientWidth - this.left() - MARGIN;
    const style = (name: string) => this.renderRoot.querySelector<HTMLElement>(name)!.style;
    style('.done').transform = `scaleX(${share})`;
    style('.thumb').transform = `translateX(${share * width}px)`;
    style('.needle').left = `${this.left() + share * width}px`;
    this.slider.setAttribute('aria-valuenow', String(this.numberOf(this.frame)));
    this.slider.setAttribute('aria-valuetext', this.description(this.frame));
  }

  private description(frame: number): string {
    const measured = this.tracking ? trackingText(this.tracking, frame) : errorsText(this.errors, frame);
    const own = measured !== '' && this.edited?.(frame) ? 'edited: errors are not measured' : measured;
    const texts = [own, errorsText(this.besideErrors, frame)].filter((text) => text !== '');
    return [`frame ${numberText(this.numberOf(frame))}`, ...texts].join(this.besideErrors ? ' | ' : ' · ');
  }

  private frameAt(event: PointerEvent): number {
    const box = this.slider.getBoundingClientRect();
    const width = Math.max(1, box.width - this.left() - MARGIN);
    const share = Math.min(1, Math.max(0, (event.clientX - box.left - this.left()) / width));
    const [first, last] = [0, this.frames - 1].map((k) => this.numberOf(k));
    return Math.round(placeOf(this.frameNumbers, first + share * (last - first)));
  }

  private grab(event: PointerEvent) {
    if (event.button !== 0) return;
    this.slider.setPointerCapture(event.pointerId);
    this.seek(this.frameAt(event));
  }

  private move(event: PointerEvent) {
    const frame = this.frameAt(event);
    this.showTip(frame);
    if (event.buttons & 1 && this.slider.hasPointerCapture(event.pointerId)) this.seek(frame);
  }

  private leave() {
    this.showTip(null);
  }

  private showTip(frame: number | null) {
    this.hovered = this.frames > 1 ? frame : null;
    const [tip, hover] = ['.tip', '.hover'].map((name) => this.renderRoot.querySelector<HTMLElement>(name)!);
    tip.hidden = hover.hidden = this.hovered === null;
    if (this.hovered === null) return;
    const width = this.clientWidth - this.left() - MARGIN;
    const at = this.left() + this.shareOf(this.hovered) * width;
    tip.textContent = this.description(this.hovered);
    const half = tip.offsetWidth / 2;
    tip.style.left = `${Math.min(this.clientWidth - half, Math.max(half, at))}px`;
    hover.style.left = `${at}px`;
  }

  private seek(frame: number) {
    this.dispatchEvent(new CustomEvent<number>('seek', { detail: frame }));
  }
}

function errorsText(errors: FrameErrors | null, frame: number): string {
  const [l2, linf] = [errors?.l2[frame] ?? NaN, errors?.linf[frame] ?? NaN];
  return Number.isFinite(linf) ? `L2 ${percent(l2)} · L∞ ${percent(linf)}` : '';
}

function trackingText(tracking: Tracking, frame: number): string {
  const score = tracking.scores[frame];
  if (!Number.isFinite(score)) return 'no surface';
  return `score ${percent(score)}${isLost(tracking, frame) ? ' · lost' : ''}`;
}
