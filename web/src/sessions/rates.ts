/** Frames per second of running sessions, from how far they are at successive looks. */

const WINDOW_MS = 15_000;

/** Remembers how many frames each session had in the last seconds. */
export class Rates {
  private readonly looks = new Map<string, { at: number; solved: number }[]>();

  /** Takes a look at a session at `now`, in milliseconds. */
  look(id: string, solved: number, now: number) {
    const looks = (this.looks.get(id) ?? []).filter((look) => now - look.at <= WINDOW_MS);
    looks.push({ at: now, solved });
    this.looks.set(id, looks);
  }

  /** Frames per second over the last seconds; null after a single look. */
  of(id: string): number | null {
    const looks = this.looks.get(id);
    if (!looks || looks.length < 2) return null;
    const [first, last] = [looks[0], looks[looks.length - 1]];
    const seconds = (last.at - first.at) / 1000;
    return seconds < 0.5 ? null : Math.max(0, last.solved - first.solved) / seconds;
  }

  forget(id: string) {
    this.looks.delete(id);
  }
}
