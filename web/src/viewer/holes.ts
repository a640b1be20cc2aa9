import type { Transport } from './transport';

/** Frames that did not come, and why. */
export interface Hole {
  readonly first: number;
  readonly count: number;
  readonly problem: string;
}

/** Frames that could not be loaded: playing leaves them out. */
export class Holes {
  private readonly holes = new Map<number, Hole>();
  private readonly told = new Set<Hole>();

  add(hole: Hole) {
    if (!this.at(hole.first)) this.holes.set(hole.first, hole);
  }

  at(frame: number): Hole | null {
    for (const hole of this.holes.values()) {
      if (frame >= hole.first && frame < hole.first + hole.count) return hole;
    }
    return null;
  }

  /** What is wrong with the frame; null where nothing is, or where it was said before. */
  news(frame: number): string | null {
    const hole = this.at(frame);
    if (!hole || this.told.has(hole)) return null;
    this.told.add(hole);
    return hole.problem;
  }

  /** Goes on at the first frame that may come: past the end when playback loops. Stops if every frame left is damaged. */
  past(transport: Transport): Transport {
    let frame = Math.floor(transport.position);
    // Each hole is met once, and one of them a second time around the end.
    for (let left = this.holes.size + 1; left > 0; left--) {
      const hole = this.at(frame);
      if (!hole) return frame === Math.floor(transport.position) ? transport : { ...transport, position: frame };
      frame = transport.direction > 0 ? hole.first + hole.count : hole.first - 1;
      if (frame >= 0 && frame < transport.frames) continue;
      if (transport.repeat === 'once' || !transport.complete) break;
      frame = transport.direction > 0 ? 0 : transport.frames - 1;
    }
    return { ...transport, playing: false };
  }

  clear() {
    this.holes.clear();
    this.told.clear();
  }
}
