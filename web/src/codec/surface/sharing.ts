/**
 * Which corners of a point share a value. Across an edge both ends are mostly shared, or, at a seam, neither is; docs/FORMAT.md, "surf".
 * `crates/codec/src/surface/sharing.rs` is the reference.
 */

import { CodedDataError } from '../error';
import { IntegerModels } from '../integers';
import type { Polygons } from '../polygons';
import { BinaryModels, RangeDecoder } from '../rangeDecoder';

const NONE = 0xffffffff;

/** A number for each corner, counted from 0 as they come, and how many there are. */
export interface Sharing {
  readonly numbers: Uint32Array;
  readonly count: number;
}

/** The numbers of each point's corners: a list for each point, the newest first. */
export class NumbersOfPoints {
  private readonly newest: Uint32Array;
  private readonly older: number[] = [];

  constructor(points: number) {
    this.newest = new Uint32Array(points).fill(NONE);
  }

  get count(): number {
    return this.older.length;
  }

  /** Gives a point one more number. */
  add(point: number): number {
    this.older.push(this.newest[point]);
    return (this.newest[point] = this.older.length - 1);
  }

  /** The number of a point that came last; undefined where it has none. */
  first(point: number): number | undefined {
    return this.newest[point] === NONE ? undefined : this.newest[point];
  }

  /** The one of the same point that came before. */
  next(number: number): number | undefined {
    return this.older[number] === NONE ? undefined : this.older[number];
  }
}

/** How the face across an edge has the other end: as this one, not known yet, or otherwise. */
const [SHARED, UNKNOWN, SPLIT] = [1, 2, 3];

/** What the face across an edge says of a corner. */
interface Across {
  readonly number: number;
  readonly otherEnd: number;
}

export function decodeSharing(bytes: Uint8Array, faces: Polygons, points: number): Sharing {
  return new SharingDecoder(new RangeDecoder(bytes), faces, points).run();
}

class SharingDecoder {
  private readonly first = new BinaryModels(16);
  private readonly second = new BinaryModels(4);
  private readonly places = new IntegerModels(1);
  private readonly values: NumbersOfPoints;
  private readonly numbers: Uint32Array;
  /** For each directed edge of the faces so far the corner that it begins at, and that one's next. */
  private readonly edges = new Map<number, number>();
  private readonly nextCorner: Uint32Array;
  /** Corners that have a number. */
  private known = 0;

  constructor(
    private readonly decoder: RangeDecoder,
    private readonly faces: Polygons,
    private readonly points: number,
  ) {
    this.values = new NumbersOfPoints(points);
    this.numbers = new Uint32Array(faces.corners.length);
    this.nextCorner = new Uint32Array(faces.corners.length);
  }

  run(): Sharing {
    const { corners, counts } = this.faces;
    for (const count of counts) {
      const [begin, end] = [this.known, this.known + count];
      for (let k = begin; k < end; k++) {
        const [before, after] = [k > begin ? k - 1 : end - 1, k + 1 < end ? k + 1 : begin];
        this.numbers[k] = this.corner(k, before, after);
        this.known = k + 1;
      }
      for (let k = begin; k < end; k++) {
        this.nextCorner[k] = k + 1 < end ? k + 1 : begin;
        this.edges.set(corners[k] * this.points + corners[this.nextCorner[k]], k);
      }
    }
    return { numbers: this.numbers, count: this.values.count };
  }

  private corner(at: number, before: number, after: number): number {
    const { corners } = this.faces;
    const point = corners[at];
    const leaving = this.look(point, corners[before], before, true);
    const arriving = this.look(corners[after], point, after, false);
    const context = 4 * (leaving?.otherEnd ?? 0) + (arriving?.otherEnd ?? 0);
    const isSwapped = arriving !== null && (leaving === null || arriving.otherEnd < leaving.otherEnd);
    const [likely, other] = isSwapped ? [arriving, leaving] : [leaving, arriving];
    const guess = likely?.number ?? this.values.first(point);
    if (guess === undefined) return this.values.add(point);
    if (this.decoder.bit(this.first, context) === 1) return guess;
    const second = other !== null && other.number !== guess ? other : null;
    if (second !== null && this.decoder.bit(this.second, second.otherEnd) === 1) return second.number;
    const place = this.places.natural(this.decoder, 0);
    return place === 0 ? this.values.add(point) : this.olderValue(point, place - 1, guess, second?.number);
  }

  /** What a directed edge of a face before says of one of its ends, the first one or the last; `other` is the corner at its other end. */
  private look(from: number, to: number, other: number, isFirst: boolean): Across | null {
    const start = this.edges.get(from * this.points + to);
    if (start === undefined) return null;
    const [own, far] = isFirst ? [start, this.nextCorner[start]] : [this.nextCorner[start], start];
    const otherEnd = other >= this.known ? UNKNOWN : this.numbers[other] === this.numbers[far] ? SHARED : SPLIT;
    return { number: this.numbers[own], otherEnd };
  }

  /** The value at a place among those of a point that were not ruled out. */
  private olderValue(point: number, place: number, guess: number, other: number | undefined): number {
    let left = place;
    for (let value = this.values.first(point); value !== undefined; value = this.values.next(value)) {
      if (value === guess || value === other) continue;
      if (left === 0) return value;
      left--;
    }
    throw new CodedDataError('corners share what is not there');
  }
}
