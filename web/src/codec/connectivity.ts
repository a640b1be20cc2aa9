/**
 * Faces of a mesh, found by a walk from a face across an edge to the next: most corners are then vertices whose edges still wait for a face, or are met for the
 * first time; docs/FORMAT.md, "Faces".
 */

import { adjacency, type Polygons } from './polygons';
import { CodedDataError } from './error';
import { type Gate, Gates, MAX_TO_COME } from './gates';
import { IntegerModels } from './integers';
import { OpenEdges } from './openEdges';
import { BinaryModels, RangeDecoder } from './rangeDecoder';
import { MAX_FAR_POINTS, decodeOrder } from './vertexOrder';

/** Faces at a vertex are told apart up to this number less one. */
const VALENCES = 9;
/** Pairs of such numbers. */
const PAIRS = VALENCES * VALENCES;
/** Open edges of a vertex that are sorted anew with it, in either direction: ordinary meshes have no more. */
const MAX_NEARER = 4;
/** Vertices that a corner is looked for among, those that open edges lead to. */
const MAX_NEAR = 8;
const MAX_COUNT = 0xffffffff;

const WRONG_COUNTS = 'faces are not those that the header counts';

/** Decodes `faces` faces with `corners` corners in all, over so many points. */
export function decodeFaces(bytes: Uint8Array, points: number, faces: number, corners: number): Polygons {
  const decoder = new RangeDecoder(bytes);
  const polygons = new Walk(decoder, points, faces, corners).run();
  const isFar = decoder.bits(1) === 1;
  if (isFar && points > MAX_FAR_POINTS)
    throw new CodedDataError('the order of so many vertices cannot have been written');
  const numbers = new Uint32Array(points);
  decodeOrder(decoder, adjacency(polygons, points), isFar).forEach((vertex, number) => (numbers[vertex] = number));
  return { counts: polygons.counts, corners: polygons.corners.map((vertex) => numbers[vertex]) };
}

/** Vertices are called by their turn: the numbers of the mesh follow after the faces. */
class Walk {
  /** Ends of the directed edges that wait for their opposite, by where these begin, and the other way round. */
  private readonly leaving: OpenEdges[];
  private readonly arriving: OpenEdges[];
  /** Faces that each vertex still is a corner of. */
  private readonly facesAt: Uint32Array;
  /** The last face, counted from 1, that each vertex is a corner of. */
  private readonly faceOf: Uint32Array;
  private met = 0;
  private readonly gates = new Gates();
  private arity = 3;
  private readonly counts: Uint32Array;
  private readonly corners: Uint32Array;
  private facesRead = 0;
  private cornersRead = 0;
  private readonly across = new BinaryModels(9);
  private readonly more = new BinaryModels(1);
  private readonly sameArity = new BinaryModels(1);
  private readonly firstTime = new BinaryModels(2 * PAIRS);
  private readonly place = new BinaryModels(8 * MAX_NEAR);
  private readonly arities = new IntegerModels(1);
  private readonly faceCounts = new IntegerModels(1);

  constructor(
    private readonly decoder: RangeDecoder,
    private readonly points: number,
    faces: number,
    corners: number,
  ) {
    this.leaving = Array.from({ length: points }, () => new OpenEdges());
    this.arriving = Array.from({ length: points }, () => new OpenEdges());
    this.facesAt = new Uint32Array(points);
    this.faceOf = new Uint32Array(points);
    this.counts = new Uint32Array(faces);
    this.corners = new Uint32Array(corners);
  }

  run(): Polygons {
    do {
      for (let gate = this.gate(); gate !== null; gate = this.gate()) {
        if (this.decoder.bit(this.across, this.acrossContext(gate)) === 1) this.face(gate);
        else this.close(gate[0], gate[1]);
      }
    } while (this.part());
    if (this.facesRead !== this.counts.length || this.cornersRead !== this.corners.length)
      throw new CodedDataError(WRONG_COUNTS);
    return { counts: this.counts, corners: this.corners };
  }

  /** Reads the first face of another part of the mesh; false where there is none. */
  private part(): boolean {
    const follows = this.decoder.bit(this.more, 0) === 1;
    if (follows) this.face(null);
    return follows;
  }

  /** The next edge that still waits for a face. */
  private gate(): Gate | null {
    for (let gate = this.gates.take(); gate !== null; gate = this.gates.take()) {
      if (this.leaving[gate[0]].has(gate[1])) return gate;
    }
    return null;
  }

  private acrossContext([from, to]: Gate): number {
    return 3 * Math.min(this.facesAt[from], 2) + Math.min(this.facesAt[to], 2);
  }

  /** The edge waits no longer; false if it did not. */
  private close(from: number, to: number): boolean {
    const wasOpen = this.leaving[from].remove(to);
    if (wasOpen) this.arriving[to].remove(from);
    return wasOpen;
  }

  /** Reads a face, which begins with the opposite of the gate's edge where there is a gate, and takes it into the walk. */
  private face(gate: Gate | null): void {
    if (this.decoder.bit(this.sameArity, 0) === 1) this.arity = this.arities.natural(this.decoder, 0);
    const room = this.corners.length - this.cornersRead;
    if (this.arity === 0 || this.arity > room || this.facesRead === this.counts.length)
      throw new CodedDataError(WRONG_COUNTS);
    this.counts[this.facesRead++] = this.arity;
    const face = gate === null ? [] : [gate[1], gate[0]].slice(0, this.arity);
    face.forEach((vertex) => (this.faceOf[vertex] = this.facesRead));
    while (face.length < this.arity) {
      const closes = gate !== null && face.length + 1 === this.arity;
      const vertex = this.corner(face, closes);
      face.push(vertex);
      this.faceOf[vertex] = this.facesRead;
    }
    this.corners.set(face, this.cornersRead);
    this.cornersRead += face.length;
    this.join(face);
  }

  /** Closes the edges of a face that waited for it and opens the others. */
  private join(face: readonly number[]): void {
    const opened: Gate[] = [];
    const nearer: number[] = [];
    for (let k = 0; k < face.length; k++) {
      const from = face[k];
      const to = face[k + 1 < face.length ? k + 1 : 0];
      if (!this.close(to, from)) {
        this.leaving[from].add(to);
        this.arriving[to].add(from);
        opened.push([from, to]);
      }
      if (this.facesAt[from] > 0) {
        this.facesAt[from]--;
        nearer.push(from);
      }
    }
    for (const [from, to] of opened) this.gates.add(from, to, Math.min(this.facesAt[from], this.facesAt[to]));
    nearer.forEach((vertex) => this.requeueOpenEdges(vertex));
  }

  /** Sorts the open edges of a vertex anew where none of their ends has fewer faces to come. */
  private requeueOpenEdges(vertex: number): void {
    const toCome = this.facesAt[vertex];
    if (toCome >= MAX_TO_COME) return;
    for (const end of this.leaving[vertex].newest().slice(-MAX_NEARER)) {
      if (this.facesAt[end] >= toCome) this.gates.add(vertex, end, toCome);
    }
    for (const end of this.arriving[vertex].newest().slice(-MAX_NEARER)) {
      if (this.facesAt[end] >= toCome) this.gates.add(end, vertex, toCome);
    }
  }

  /** Reads the vertex after those of `face`; `closes` says that an edge leads from it back to the gate. */
  private corner(face: readonly number[], closes: boolean): number {
    if (face.length === 0) {
      const isNew = this.decoder.bit(this.firstTime, 0) === 1;
      return isNew ? this.newVertex() : this.metVertex();
    }
    const first = face[0];
    const previous = face[face.length - 1];
    const { near, both } = this.near(previous, first, closes);
    if (this.decoder.bit(this.firstTime, this.firstTimeContext(previous, first, both)) === 1) return this.newVertex();
    const base = MAX_NEAR * (2 * this.lastOnes(previous, first) + (both ? 1 : 0));
    for (let k = 0; k < near.length; k++) {
      if (this.decoder.bit(this.place, base + k) === 0) return near[k];
    }
    return this.metVertex();
  }

  /** Vertices that an open edge leads from to the last corner, or to from the first one, the likeliest first; whether one is both. */
  private near(previous: number, first: number, closes: boolean): { near: number[]; both: boolean } {
    const back = closes ? this.leaving[first].newest() : [];
    const arriving = this.arriving[previous].newest();
    const ofBoth: number[] = [];
    const ofOne: number[] = [];
    for (let k = arriving.length - 1; k >= 0; k--) {
      (back.includes(arriving[k]) && !this.isCorner(arriving[k]) ? ofBoth : ofOne).push(arriving[k]);
    }
    const near: number[] = [];
    for (const x of [...ofBoth.reverse(), ...ofOne, ...[...back].reverse()]) {
      if (near.length < MAX_NEAR && !this.isCorner(x) && !near.includes(x)) near.push(x);
    }
    return { near, both: ofBoth.length > 0 };
  }

  private isCorner(vertex: number): boolean {
    return this.faceOf[vertex] === this.facesRead;
  }

  private firstTimeContext(previous: number, first: number, both: boolean): number {
    return (both ? PAIRS : 0) + VALENCES * this.valence(previous) + this.valence(first);
  }

  private valence(vertex: number): number {
    return Math.min(this.facesAt[vertex], VALENCES - 1);
  }

  /** Which of two vertices have this face alone to come: 1 and 2, added up. */
  private lastOnes(previous: number, first: number): number {
    return (this.facesAt[previous] === 1 ? 1 : 0) + (this.facesAt[first] === 1 ? 2 : 0);
  }

  private newVertex(): number {
    if (this.met === this.points) throw new CodedDataError(WRONG_COUNTS);
    // Of the face that is read it is a corner now.
    this.facesAt[this.met] = Math.min(this.faceCounts.natural(this.decoder, 0) + 1, MAX_COUNT);
    return this.met++;
  }

  /** Reads a vertex that was met, but that nothing leads to. */
  private metVertex(): number {
    const turn = this.decoder.bits(32 - Math.clz32(this.met));
    if (turn >= this.met) throw new CodedDataError('a face names a vertex that was not met');
    return turn;
  }
}
