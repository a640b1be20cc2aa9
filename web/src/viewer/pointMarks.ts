import { html } from 'lit';
import { pointAt as positionOf } from '../coordinates/vector';
import { Projection } from '../render/projection';
import type { Player } from './player';
import { count, percent, threeDigits } from '../text';

/** How far from the pointer a point may be, in CSS pixels. */
const REACH = 14;

/** Marks in the picture: the worst point of the frame, and the one under the pointer, each with its number and its distance from the original. */
export class PointMarks {
  private pointer: Spot | null = null;

  /** The marks; {@link place} puts them where they belong. */
  readonly template = html`<div class="mark worst" hidden>
      <i></i><span class="figures"><b></b><data></data></span>
    </div>
    <div class="mark probe" hidden>
      <i></i><span class="figures"><b></b><data></data></span>
    </div>`;

  constructor(private readonly root: ParentNode) {}

  /** Follows the pointer above a canvas. */
  follow(canvas: HTMLCanvasElement, player: Player) {
    const point = (event: PointerEvent) => {
      // What is dragged is the camera.
      const drags = event.type === 'pointermove' && event.buttons !== 0;
      this.pointer = drags || event.type === 'pointerleave' ? null : { x: event.offsetX, y: event.offsetY };
      this.place(player);
    };
    for (const type of ['pointermove', 'pointerdown', 'pointerleave'] as const) canvas.addEventListener(type, point);
  }

  /** To be called after every picture. */
  place(player: Player) {
    const { heatMap, comparison, stage } = player;
    const [worst, probe] = ['.worst', '.probe'].map((mark) => this.root.querySelector<HTMLElement>(`.mark${mark}`));
    if (!worst || !probe) return;
    const { measured } = heatMap;
    const isShown = heatMap.kind === 'error' && measured !== null && comparison.side !== 'original';
    worst.hidden = !isShown;
    probe.hidden = true;
    if (!isShown) return;
    const picture: Picture = {
      matrix: stage.clipMatrix.elements,
      width: stage.canvas.clientWidth,
      height: stage.canvas.clientHeight,
    };
    const projection = new Projection(stage.clipMatrix, picture.width, picture.height);
    const begin = comparison.original && comparison.side === 'both' ? stage.line : 0;
    const put = (mark: HTMLElement, point: number) => {
      const spot = projection.place(positionOf(measured.places, point));
      mark.hidden = !spot || spot.x < begin;
      if (!spot) return;
      mark.style.transform = `translate(${spot.x}px, ${spot.y}px)`;
      mark.classList.toggle('flipped', spot.x > 0.6 * picture.width);
      const value = measured.values[point];
      const distance = `${percent(value)} (${threeDigits(value * stage.decoder.diagonal)})`;
      mark.querySelector('b')!.textContent = `Point ${count(point)}: `;
      mark.querySelector('data')!.textContent = distance;
    };
    put(worst, measured.worst);
    const under =
      this.pointer && this.pointer.x >= begin ? pointAt(measured.places, this.pointer, picture, REACH) : null;
    if (under !== null && under !== measured.worst) put(probe, under);
  }
}

/** Where something is in the picture, in CSS pixels from its upper left corner. */
export interface Spot {
  readonly x: number;
  readonly y: number;
}

/** A picture: what takes points to clip space (4 × 4, column by column), and its size in CSS pixels. */
export interface Picture {
  readonly matrix: ArrayLike<number>;
  readonly width: number;
  readonly height: number;
}

/** The point that is seen at a spot: of those within `reach` pixels, the one nearest to the eye; null if no point is within reach. */
export function pointAt(positions: ArrayLike<number>, spot: Spot, picture: Picture, reach: number): number | null {
  const { matrix: m, width, height } = picture;
  let [nearest, depth] = [-1, Infinity];
  // Nothing is allocated for a point: there may be hundreds of thousands.
  for (let k = 0; k < positions.length; k += 3) {
    const x = positions[k];
    const y = positions[k + 1];
    const z = positions[k + 2];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (!(w > 0 && w < depth)) continue;
    const right = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w / 2 + 0.5) * width - spot.x;
    const down = (0.5 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w / 2) * height - spot.y;
    if (right * right + down * down > reach * reach) continue;
    nearest = k / 3;
    depth = w;
  }
  return nearest < 0 ? null : nearest;
}
