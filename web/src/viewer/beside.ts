import type { Capture, FrameErrors } from '../capture';
import { numberAt, placeOf, type FrameNumbers } from './frameNumbers';
import type { Companion } from './playback';
import { Player } from './player';
import type { Transport } from './transport';

/** A number this far from that of a frame is its number. */
const SAME = 1e-6;

/** A capture beside another one: at the frame of the same number, from the same side, with the same layers and colours; which axis points up is its own. */
export class Beside implements Companion {
  readonly player: Player;
  private aligned: { readonly of: FrameErrors; readonly frames: number; readonly errors: FrameErrors } | null = null;

  /** Throws one sentence for a person where the browser cannot draw the capture. */
  constructor(
    canvas: HTMLCanvasElement,
    capture: Capture,
    private readonly lead: Player,
  ) {
    this.player = new Player(canvas, capture, lead);
    const { controls, heatMap } = this.player;
    // Whoever turns one picture turns both.
    controls.onMove = () => {
      if (controls.destination !== lead.controls.destination) lead.controls.go(controls.destination);
    };
    heatMap.peer = lead.heatMap;
    lead.heatMap.peer = heatMap;
    lead.playback.companion = this;
    lead.refresh();
  }

  /** The frame that belongs to the place of the lead; null where this capture has none of its number. */
  get frame(): number | null {
    const { numbers, position, frames } = this.lead.transport;
    return frameOf(numberAt(numbers, Math.min(Math.floor(position), Math.max(0, frames - 1))), this.player.transport);
  }

  /** Errors of this capture at the frames of the lead; NaN where it has none of their number. */
  get errors(): FrameErrors {
    const { errors } = this.player.capture;
    const { frames, numbers } = this.lead.transport;
    if (this.aligned?.of === errors && this.aligned.frames === frames) return this.aligned.errors;
    const [l2, linf] = [new Float32Array(frames).fill(NaN), new Float32Array(frames).fill(NaN)];
    for (let k = 0; k < frames; k++) {
      const frame = frameOf(numberAt(numbers, k), this.player.transport);
      if (frame === null) continue;
      l2[k] = errors.l2[frame] ?? NaN;
      linf[k] = errors.linf[frame] ?? NaN;
    }
    this.aligned = { of: errors, frames, errors: { l2, linf } };
    return this.aligned.errors;
  }

  prepare(transport: Transport): boolean {
    return this.player.playback.prepare(this.transportAt(transport));
  }

  show() {
    const { lead, player } = this;
    if (player.controls.destination !== lead.controls.destination) player.controls.go(lead.controls.destination, true);
    if (player.layers !== lead.layers) player.layers = lead.layers;
    const { kind, range } = lead.heatMap;
    if (player.heatMap.kind !== kind || player.heatMap.range !== range) player.setHeat(kind, range);
    player.follow(lead, { ...this.transportAt(lead.transport), playing: false });
  }

  dispose() {
    this.lead.playback.companion = null;
    this.lead.heatMap.peer = null;
    this.player.dispose();
  }

  private transportAt(lead: Transport): Transport {
    const { frames, numbers, complete } = this.player.transport;
    const place = placeOf(numbers, numberAt(lead.numbers, lead.position));
    return { ...lead, frames, numbers, complete, position: Math.max(0, Math.min(place, frames - 1)) };
  }
}

function frameOf(number: number, { numbers, frames }: { numbers: FrameNumbers; frames: number }): number | null {
  const frame = Math.round(placeOf(numbers, number));
  return frame >= 0 && frame < frames && Math.abs(numberAt(numbers, frame) - number) < SAME ? frame : null;
}
