/** Edges at which a walk over a mesh may go on, directed and in the order in which they are tried; some wait no longer. */

/** Gates are told apart by the faces to come at their ends up to this number. */
export const MAX_TO_COME = 15;

/** Entries of gates that were taken are dropped from the front of the list when they are so many, and half of it. */
const MIN_DROPPED = 1 << 10;

export type Gate = readonly [from: number, to: number];

/** The oldest first. */
class GateQueue {
  /** Both ends of each; those before `next` are taken. */
  private readonly ends: number[] = [];
  private next = 0;

  add(from: number, to: number): void {
    this.ends.push(from, to);
  }

  take(): Gate | null {
    if (this.next === this.ends.length) return null;
    const gate: Gate = [this.ends[this.next], this.ends[this.next + 1]];
    this.next += 2;
    if (this.next === this.ends.length || (this.next >= MIN_DROPPED && 2 * this.next >= this.ends.length)) {
      this.ends.splice(0, this.next);
      this.next = 0;
    }
    return gate;
  }
}

/** By how few faces are to come at one of their ends, which is then complete soon; those that were opened or came nearer first before others. */
export class Gates {
  private readonly queues = Array.from({ length: MAX_TO_COME + 1 }, () => new GateQueue());

  /** @param toCome fewest faces that are to come at an end of the edge. */
  add(from: number, to: number, toCome: number): void {
    this.queues[Math.min(toCome, MAX_TO_COME)].add(from, to);
  }

  /** Takes the next gate off the lists; null where there is none. */
  take(): Gate | null {
    for (const queue of this.queues) {
      const gate = queue.take();
      if (gate !== null) return gate;
    }
    return null;
  }
}
