/** A set of numbers below a limit that is counted in a Fenwick tree. */
export class CountedSet {
  private readonly sums: Uint32Array;
  /** The largest power of two that is not above the limit. */
  private readonly reach: number;
  private size = 0;

  constructor(limit: number) {
    this.sums = new Uint32Array(limit + 1);
    let reach = 1;
    while (2 * reach <= limit) {
      reach *= 2;
    }
    this.reach = reach;
  }

  get count(): number {
    return this.size;
  }

  /** The number of the set that has so many of it below; null where there is none. */
  find(rank: number): number | null {
    if (rank < 0 || rank >= this.size) {
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
    return at;
  }

  add(number: number): void {
    this.size++;
    for (let at = number + 1; at < this.sums.length; at += at & -at) {
      this.sums[at]++;
    }
  }

  remove(number: number): void {
    this.size--;
    for (let at = number + 1; at < this.sums.length; at += at & -at) {
      this.sums[at]--;
    }
  }

  clear(): void {
    this.size = 0;
    this.sums.fill(0);
  }
}
