import { css, html, LitElement, nothing, svg } from 'lit';
import { customElement, property, state } from 'lit/decorators.js';
import { controls } from '../style/controls';
import { type FrameNumbers, rangeText } from '../viewer/frameNumbers';
import { weightAt, type FrameRange } from './cageEdit';
import { draggedRange, partAt, type RangePart } from './rangeDrag';

/** Pixels beside a handle that count as it, for a mouse and for a finger. */
const [MOUSE_REACH, TOUCH_REACH] = [8, 18];

const CURSORS: Readonly<Record<RangePart, string>> = {
  first: 'ew-resize',
  last: 'ew-resize',
  easeIn: 'col-resize',
  easeOut: 'col-resize',
  whole: 'grab',
};

/**
 * The frames that an edit is kept over, drawn as high as it counts in each, to be dragged: ends below, eases above, all of it in between. Hidden from
 * screen readers, which have the fields of the panel.
 *
 * @fires rangechange with the range, while it is dragged
 * @fires rangeend when the drag is over
 */
@customElement('cager-range-strip')
export class RangeStrip extends LitElement {
  static override styles = [
    controls,
    css`
      :host {
        display: block;
        position: relative;
        height: 24px;
        touch-action: none;
        user-select: none;
      }
      svg,
      i,
      .ground {
        position: absolute;
        pointer-events: none;
      }
      .ground {
        inset: 4px 0 3px;
        border-radius: 3px;
        background: color-mix(in srgb, var(--cager-muted) 14%, transparent);
      }
      svg {
        inset: 4px 0 3px;
        width: 100%;
        height: 17px;
        overflow: visible;
        fill: color-mix(in srgb, var(--cager-cage) 38%, transparent);
        stroke: var(--cager-cage);
        stroke-width: 1.5;
        stroke-linejoin: round;
      }
      i {
        background: var(--cager-cage);
        border: 1.5px solid var(--cager-surface);
        translate: -50% 0;
      }
      i.end {
        bottom: 0;
        width: 8px;
        height: 14px;
        border-radius: 3px;
      }
      i.ease {
        top: 0;
        width: 11px;
        height: 11px;
        border-radius: 50%;
      }
      i.held {
        outline: 2px solid var(--cager-accent);
      }
      @media (pointer: coarse) {
        :host {
          height: 36px;
        }
        svg {
          height: 29px;
        }
        i.end {
          height: 20px;
          width: 12px;
        }
        i.ease {
          width: 16px;
          height: 16px;
        }
      }
    `,
  ];

  @property({ attribute: false }) range!: FrameRange;
  @property({ attribute: false }) frames = 0;
  @property({ attribute: false }) frameNumbers: FrameNumbers = null;
  /** Where a frame is in the width of the strip, 0 to 1. */
  @property({ attribute: false }) shareOf!: (frame: number) => number;
  @property({ attribute: false }) frameAt!: (event: PointerEvent) => number;
  @state() private held: RangePart | null = null;
  private start: { readonly event: PointerEvent; readonly frame: number; readonly range: FrameRange } | null = null;
  private isMoved = false;

  override connectedCallback() {
    super.connectedCallback();
    this.setAttribute('aria-hidden', 'true');
    this.addEventListener('pointerdown', (event) => this.grab(event));
    this.addEventListener('pointermove', (event) => this.move(event));
    for (const end of ['pointerup', 'pointercancel'] as const) this.addEventListener(end, () => this.drop());
  }

  override render() {
    const { range, held } = this;
    const { first, last, easeIn, easeOut } = range;
    if (last < first) return html`<div class="ground"></div>`;
    const share = (frame: number) => `${100 * this.shareOf(frame)}%`;
    const handle = (part: RangePart, kind: string, frame: number) =>
      html`<i class="${kind} ${held === part ? 'held' : ''}" .style=${`left: ${share(frame)}`}></i>`;
    return html`
      <div class="ground"></div>
      ${drawing(range, this.shareOf)} ${handle('first', 'end', first)} ${handle('last', 'end', last)}
      ${handle('easeIn', 'ease', first + easeIn)} ${handle('easeOut', 'ease', last - easeOut)}
      ${
        held
          ? html`<span class="tip figures" .style=${`left: ${share(Math.round((first + last) / 2))}`}>
              ${rangeText(this.frameNumbers, first, last)}, ease in ${easeIn}, out ${easeOut}
            </span>`
          : nothing
      }
    `;
  }

  private partAt(event: PointerEvent, way = 0): RangePart | null {
    if (this.range.last < this.range.first) return null;
    const { left, top, width, height } = this.getBoundingClientRect();
    const reach = event.pointerType === 'touch' ? TOUCH_REACH : MOUSE_REACH;
    const isUpper = event.clientY < top + height / 2;
    return partAt(this.range, event.clientX - left, isUpper, reach, (frame) => width * this.shareOf(frame), way);
  }

  private grab(event: PointerEvent) {
    const part = this.partAt(event);
    if (event.button !== 0 || !part) return;
    event.preventDefault();
    this.setPointerCapture(event.pointerId);
    this.held = part;
    this.start = { event, frame: this.frameAt(event), range: this.range };
    this.isMoved = false;
  }

  private move(event: PointerEvent) {
    if (!this.start || !this.held) {
      const part = this.partAt(event);
      this.style.cursor = part ? CURSORS[part] : '';
      return;
    }
    const by = this.frameAt(event) - this.start.frame;
    if (by === 0 && !this.isMoved) return;
    if (!this.isMoved) this.held = this.partAt(this.start.event, by) ?? this.held;
    this.isMoved = true;
    const detail = draggedRange(this.held, this.start.range, by, this.frames);
    this.dispatchEvent(new CustomEvent<FrameRange>('rangechange', { detail, bubbles: true, composed: true }));
  }

  private drop() {
    if (!this.held) return;
    this.held = this.start = null;
    this.dispatchEvent(new Event('rangeend', { bubbles: true, composed: true }));
  }
}

function drawing(range: FrameRange, shareOf: (frame: number) => number) {
  const { first, last } = range;
  const points = [`${shareOf(first)},1`];
  for (let frame = first; frame <= last; frame++) points.push(`${shareOf(frame)},${1 - weightAt(range, frame)}`);
  points.push(`${shareOf(last)},1`);
  return svg`<svg viewBox="0 0 1 1" preserveAspectRatio="none">
    <polygon points=${points.join(' ')} vector-effect="non-scaling-stroke" />
  </svg>`;
}
