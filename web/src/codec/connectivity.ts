/**
 * Faces of a mesh, found by a walk from a face across an edge to the next: most corners are then vertices whose edges still wait for a face, or are met for the
 * first time. `codec/src/connectivity.rs` is the reference.
 */

import { CodedDataError } from './error';
import { IntegerModels, SIZE_CLASSES, sizeClass } from './integers';
import type { Polygons } from './polygons';
import { BinaryModels, RangeDecoder } from './rangeDecoder';
import { UnmetVertices } from './unmetVertices';

/** Faces that meet at a vertex are counted up to this number. */
const VALENCES = 9;
/** The context of a corner that open edges on both sides lead to; the others are pairs of valences. */
const BETWEEN_OPEN_EDGES = VALENCES * VALENCES;
/** Open edges of a vertex that are looked at: around a hub there may be very many. */
const NEWEST = 16;
const MOST_NEAR = 8;

const WRONG_COUNTS = 'faces are not those that the header counts';

/**
 * Decodes `faces` faces with `corners` corners in all, over so many points.
 *
 * @throws {CodedDataError} for bytes that the encoder did not write.
 */
export function decodeFaces(bytes: Uint8Array, points: number, faces: number, corners: number): Polygons {
  const decoder = new RangeDecoder(bytes);
  return new Walk(decoder, points, faces, corners).run();
}

class Walk {
  private readonly inRings: boolean;
  /** Ends of the directed edges that wait for their opposite, by where these begin, and the other way round. */
  private readonly leaving: number[][];
  private readonly arriving: number[][];
  private readonly facesAt: Uint8ClampedArray;
  /** Directed edges; those before `nextGate` are done. */
  private readonly gates: [number, number][] = [];
  private nextGate = 0;
  private last = 0;
  private before = 0;
  private arity = 3;
  private readonly counts: Uint32Array;
  private readonly corners: Uint32Array;
  private facesRead = 0;
  private cornersRead = 0;
  private readonly across = new BinaryModels(1);
  private readonly more = new BinaryModels(1);
  private readonly sameArity = new BinaryModels(1);
  private readonly firstTime = new BinaryModels(BETWEEN_OPEN_EDGES + 1);
  private readonly place = new BinaryModels(2 * MOST_NEAR);
  private readonly arities = new IntegerModels(1);
  private readonly numbers = new IntegerModels(SIZE_CLASSES);
  private readonly unmet: UnmetVertices;

  constructor(
    private readonly decoder: RangeDecoder,
    private readonly points: number,
    faces: number,
    corners: number,
  ) {
    this.inRings = decoder.bits(1) === 1;
    this.leaving = Array.from({ length: points }, () => []);
    this.arriving = Array.from({ length: points }, () => []);
    this.facesAt = new Uint8ClampedArray(points);
    this.counts = new Uint32Array(faces);
    this.corners = new Uint32Array(corners);
    this.unmet = new UnmetVertices(points);
  }

  run(): Polygons {
    for (;;) {
      for (let gate = this.gate(); gate !== null; gate = this.gate()) {
        if (this.decoder.bit(this.across, 0) === 1) {
          this.face(gate);
        } else {
          this.close(gate[0], gate[1]);
        }
      }
      if (this.decoder.bit(this.more, 0) === 0) {
        break;
      }
      this.face(null);
    }
    if (this.facesRead !== this.counts.length || this.cornersRead !== this.corners.length) {
      throw new CodedDataError(WRONG_COUNTS);
    }
    return { counts: this.counts, corners: this.corners };
  }

  /** The next edge that still waits for a face. */
  private gate(): readonly [number, number] | null {
    while (this.gates.length > this.nextGate) {
      const gate = this.inRings ? this.gates[this.nextGate++] : this.gates.pop()!;
      if (this.leaving[gate[0]].includes(gate[1])) {
        return gate;
      }
    }
    return null;
  }

  /** The edge waits no longer; false if it did not. */
  private close(from: number, to: number): boolean {
    const wasOpen = removeLast(this.leaving[from], to);
    if (wasOpen) {
      removeLast(this.arriving[to], from);
    }
    return wasOpen;
  }

  /** Reads a face, which begins with the opposite of the gate's edge where there is a gate, and takes it into the walk. */
  private face(gate: readonly [number, number] | null): void {
    if (this.decoder.bit(this.sameArity, 0) === 1) {
      this.arity = this.arities.natural(this.decoder, 0);
    }
    const room = this.corners.length - this.cornersRead;
    if (this.arity === 0 || this.arity > room || this.facesRead === this.counts.length) {
      throw new CodedDataError(WRONG_COUNTS);
    }
    const face = gate === null ? [] : [gate[1], gate[0]].slice(0, this.arity);
    while (face.length < this.arity) {
      const closes = gate !== null && face.length + 1 === this.arity;
      const vertex = this.corner(face, closes);
      if (vertex >= this.points) {
        throw new CodedDataError(WRONG_COUNTS);
      }
      face.push(vertex);
    }
    for (let k = 0; k < face.length; k++) {
      const from = face[k];
      const to = face[(k + 1) % face.length];
      if (!this.close(to, from)) {
        this.leaving[from].push(to);
        this.arriving[to].push(from);
        this.gates.push([from, to]);
      }
      this.facesAt[from]++;
    }
    this.counts[this.facesRead++] = face.length;
    this.corners.set(face, this.cornersRead);
    this.cornersRead += face.length;
  }

  /** Reads the vertex after those of `face`; `closes` says that an edge leads from it back to the gate. */
  private corner(face: readonly number[], closes: boolean): number {
    if (face.length === 0) {
      return this.decoder.bit(this.firstTime, 0) === 1 ? this.newVertex(this.last) : this.decoder.bits(32);
    }
    const first = face[0];
    const previous = face[face.length - 1];
    const { near, both } = this.near(face, closes);
    const context = both ? BETWEEN_OPEN_EDGES : VALENCES * this.valence(previous) + this.valence(first);
    if (this.decoder.bit(this.firstTime, context) === 1) {
      return this.newVertex(Math.max(previous, first));
    }
    const base = both ? MOST_NEAR : 0;
    for (let k = 0; k < near.length; k++) {
      if (this.decoder.bit(this.place, base + k) === 0) {
        return near[k];
      }
    }
    return this.decoder.bits(32);
  }

  /** Vertices that an open edge leads from to the last corner, or to from the first one, the likeliest first; whether one is both. */
  private near(face: readonly number[], closes: boolean): { near: number[]; both: boolean } {
    const back = closes ? this.leaving[face[0]].slice(-NEWEST) : [];
    const arriving = this.arriving[face[face.length - 1]].slice(-NEWEST);
    const ofBoth: number[] = [];
    const ofOne: number[] = [];
    for (let k = arriving.length - 1; k >= 0; k--) {
      const x = arriving[k];
      if (!face.includes(x)) {
        (back.includes(x) ? ofBoth : ofOne).push(x);
      }
    }
    const both = ofBoth.length > 0;
    const near: number[] = [];
    for (const x of [...ofBoth.reverse(), ...ofOne, ...back.reverse()]) {
      if (near.length < MOST_NEAR && !face.includes(x) && !near.includes(x)) {
        near.push(x);
      }
    }
    return { near, both };
  }

  private valence(vertex: number): number {
    return Math.min(this.facesAt[vertex], VALENCES - 1);
  }

  /** Reads a vertex met for the first time, by how many others that are not met yet lie between it and one that was. */
  private newVertex(near: number): number {
    const expected = this.unmet.before(near);
    const context = sizeClass(Math.min(this.before, 1 << 16) * 2);
    const difference = this.numbers.signed(this.decoder, context);
    this.before = (this.before + Math.min(Math.abs(difference), 1 << 20)) >> 1;
    const vertex = this.unmet.take(expected + difference);
    if (vertex === null) {
      throw new CodedDataError(WRONG_COUNTS);
    }
    this.last = vertex;
    return vertex;
  }
}

/** Removes the last occurrence of `x` from a list; false if the list does not contain it. */
function removeLast(list: number[], x: number): boolean {
  const at = list.lastIndexOf(x);
  if (at < 0) {
    return false;
  }
  list.splice(at, 1);
  return true;
}
