/** Vertices that a walk over a mesh has not met yet, counted in a Fenwick tree. */
export class UnmetVertices {
  private readonly sums: Uint32Array;
  private readonly reach: number;
  private left: number;

  constructor(points: number) {
    this.sums = Uint32Array.from({ length: points + 1 }, (_, k) => k & -k);
    let reach = 1;
    while (reach <= points) {
      reach *= 2;
    }
    this.reach = reach;
    this.left = points;
  }

  /** How many have a number below this one. */
  before(vertex: number): number {
    let count = 0;
    for (let at = Math.min(vertex, this.sums.length - 1); at > 0; at &= at - 1) {
      count += this.sums[at];
    }
    return count;
  }

  /** Removes and returns the vertex that has `rank` unmet vertices below it; null if fewer are left. */
  take(rank: number): number | null {
    if (rank < 0 || rank >= this.left) {
      return null;
    }
    const { sums } = this;
    let at = 0;
    let rest = rank;
    for (let reach = this.reach; reach >= 1; reach /= 2) {
      if (at + reach < sums.length && sums[at + reach] <= rest) {
        at += reach;
        rest -= sums[at];
      }
    }
    this.left--;
    const vertex = at;
    for (at++; at < sums.length; at += at & -at) {
      sums[at]--;
    }
    return vertex;
  }
}
