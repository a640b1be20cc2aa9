/** Most ends in a plain list; around a hub there may be as many as the mesh has edges, so that finding one there would take as long. */
const FEW = 128;
/** Ends that are looked at where the walk asks what lies near. */
const NEWEST = 16;

/** The other ends of a vertex's open edges, in the order in which they were opened; of several to the same end the newest is removed first. */
export class OpenEdges {
  private few: number[] = [];
  private many: LinkedEnds | null = null;

  has(end: number): boolean {
    return this.many === null ? this.few.includes(end) : this.many.has(end);
  }

  add(end: number): void {
    if (this.many !== null) {
      this.many.add(end);
    } else if (this.few.push(end) > FEW) {
      this.many = new LinkedEnds();
      this.few.forEach((each) => this.many!.add(each));
      this.few = [];
    }
  }

  /** Removes the newest edge to this end; false where there is none. */
  remove(end: number): boolean {
    if (this.many !== null) return this.many.remove(end);
    const at = this.few.lastIndexOf(end);
    if (at >= 0) this.few.splice(at, 1);
    return at >= 0;
  }

  /** The last ones, the oldest of them first; not to be changed. */
  newest(): readonly number[] {
    if (this.many !== null) return this.many.newest(NEWEST);
    return this.few.length > NEWEST ? this.few.slice(-NEWEST) : this.few;
  }
}

interface Link {
  readonly end: number;
  older: Link | null;
  newer: Link | null;
}

/** Ends in the order in which they came, each found at once. */
class LinkedEnds {
  private last: Link | null = null;
  private readonly byEnd = new Map<number, Link[]>();

  has(end: number): boolean {
    return this.byEnd.has(end);
  }

  add(end: number): void {
    const link: Link = { end, older: this.last, newer: null };
    if (this.last !== null) this.last.newer = link;
    this.last = link;
    const same = this.byEnd.get(end);
    if (same === undefined) this.byEnd.set(end, [link]);
    else same.push(link);
  }

  remove(end: number): boolean {
    const same = this.byEnd.get(end);
    if (same === undefined) return false;
    const { older, newer } = same.pop()!;
    if (same.length === 0) this.byEnd.delete(end);
    if (older !== null) older.newer = newer;
    if (newer !== null) newer.older = older;
    else this.last = older;
    return true;
  }

  newest(most: number): number[] {
    const ends: number[] = [];
    for (let link = this.last; link !== null && ends.length < most; link = link.older) ends.push(link.end);
    return ends.reverse();
  }
}
