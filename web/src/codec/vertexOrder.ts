/**
 * The numbers that a mesh gives its vertices, told beside faces that name them in turn: move to front (Bentley, Sleator, Tarjan and Wei 1986) over the mesh. All
 * vertices stand in a list, those near the ones numbered last in front, and each is told by its place in the list; docs/FORMAT.md, "Faces".
 */

import type { ByVertex } from './polygons';
import { CodedDataError } from './error';
import { SIZE_CLASSES, sizeClass } from './integers';
import { BinaryModels, type RangeDecoder } from './rangeDecoder';

/** A set of numbers below a limit that is counted in a Fenwick tree. */
export class CountedSet {
  private readonly sums: Uint32Array;
  /** The largest power of two that is not above the limit. */
  private readonly reach: number;
  private size = 0;

  constructor(limit: number) {
    this.sums = new Uint32Array(limit + 1);
    let reach = 1;
    while (2 * reach <= limit) reach *= 2;
    this.reach = reach;
  }

  get count(): number {
    return this.size;
  }

  /** The number of the set that has so many of it below; null where there is none. */
  find(rank: number): number | null {
    if (rank < 0 || rank >= this.size) return null;
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
    for (let at = number + 1; at < this.sums.length; at += at & -at) this.sums[at]++;
  }

  remove(number: number): void {
    this.size--;
    for (let at = number + 1; at < this.sums.length; at += at & -at) this.sums[at]--;
  }

  clear(): void {
    this.size = 0;
    this.sums.fill(0);
  }
}

/** Vertices with more neighbours move none of them when one of these is numbered. */
const MAX_PASSED_ON = 16;
/** Most points for which neighbours of neighbours are moved too. */
export const MAX_FAR_POINTS = 1 << 17;
/** Most binary digits of a place below its leading 1. */
const MAX_DIGITS = 31;

/**
 * Reads the vertex of each number, as the faces name it.
 *
 * @param isFar whether neighbours of neighbours are moved to the front too.
 * @throws {CodedDataError} where what is read is no vertex.
 */
export function decodeOrder(decoder: RangeDecoder, { starts, items }: ByVertex, isFar: boolean): Uint32Array {
  const order = new Uint32Array(starts.length - 1);
  const list = new RecencyList(order.length);
  const places = new Places();
  for (let number = 0; number < order.length; number++) {
    const vertex = list.take(places.read(decoder));
    if (vertex === null) throw new CodedDataError('vertices are not those that the faces name');
    order[number] = vertex;
    const [start, end] = [starts[vertex], starts[vertex + 1]];
    if (isFar) {
      for (let k = start; k < end; k++) {
        const w = items[k];
        if (starts[w + 1] - starts[w] <= MAX_PASSED_ON) list.choose(items, starts[w], starts[w + 1]);
      }
      list.moveChosen();
    }
    list.choose(items, start, end);
    list.moveChosen();
  }
  return order;
}

/** The time of vertices that were taken out. */
const GONE = 0xffffffff;

/** Vertices without a number, the one moved to the front last first. Each has the time at which it was moved. */
export class RecencyList {
  private readonly times: Uint32Array;
  /** Vertices by these times. */
  private readonly at: Uint32Array;
  private readonly waiting: CountedSet;
  private next = 0;
  private readonly chosen: Uint32Array;
  private readonly isChosen: Uint8Array;
  private chosenCount = 0;

  /** The first vertex stands in front. */
  constructor(points: number) {
    const capacity = 4 * points + 64;
    this.times = new Uint32Array(points);
    this.at = new Uint32Array(capacity);
    this.waiting = new CountedSet(capacity);
    this.chosen = new Uint32Array(points);
    this.isChosen = new Uint8Array(points);
    for (let vertex = points - 1; vertex >= 0; vertex--) this.push(vertex);
  }

  /** Takes out the vertex that has so many before it; null where there are not so many. */
  take(place: number): number | null {
    const time = this.waiting.find(this.waiting.count - 1 - place);
    if (time === null) return null;
    this.waiting.remove(time);
    const vertex = this.at[time];
    this.times[vertex] = GONE;
    return vertex;
  }

  /** Says that some vertices of a list are to be moved, of those that wait. */
  choose(vertices: Uint32Array, start: number, end: number): void {
    for (let k = start; k < end; k++) {
      const vertex = vertices[k];
      if (this.times[vertex] !== GONE && this.isChosen[vertex] === 0) {
        this.isChosen[vertex] = 1;
        this.chosen[this.chosenCount++] = vertex;
      }
    }
  }

  /** Moves the chosen vertices to the front, where they keep their order. */
  moveChosen(): void {
    if (this.next + this.chosenCount > this.at.length) this.renew();
    const times = this.chosen.subarray(0, this.chosenCount);
    for (let k = 0; k < times.length; k++) {
      this.isChosen[times[k]] = 0;
      times[k] = this.times[times[k]];
    }
    times.sort();
    for (let k = 0; k < times.length; k++) {
      this.waiting.remove(times[k]);
      this.push(this.at[times[k]]);
    }
    this.chosenCount = 0;
  }

  private push(vertex: number): void {
    this.times[vertex] = this.next;
    this.at[this.next] = vertex;
    this.waiting.add(this.next);
    this.next++;
  }

  /** Counts the times anew from 0. */
  private renew(): void {
    const end = this.next;
    this.waiting.clear();
    this.next = 0;
    for (let time = 0; time < end; time++) {
      const vertex = this.at[time];
      if (this.times[vertex] === time) this.push(vertex);
    }
  }
}

/** Models of places: the number of binary digits of the place plus one, in the context of the place before; then the digits, the first two by models. */
class Places {
  private readonly digits = new BinaryModels(32 * SIZE_CLASSES);
  private readonly leading = new BinaryModels(4 * (MAX_DIGITS + 1));
  private before = 0;

  read(decoder: RangeDecoder): number {
    const context = 32 * sizeClass(this.before);
    let count = 0;
    while (count < MAX_DIGITS && decoder.bit(this.digits, context + count) === 1) count++;
    const modelled = Math.min(count, 2);
    let number = 1;
    for (let k = 0; k < modelled; k++) number = 2 * number + decoder.bit(this.leading, 4 * count + number);
    number = number * 2 ** (count - modelled) + decoder.bits(count - modelled);
    this.before = number - 1;
    return this.before;
  }
}
