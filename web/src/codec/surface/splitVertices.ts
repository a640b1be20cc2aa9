/** Vertices of the mesh that is drawn: what corners share of point, texture coordinate and normal. */

import { fansOf, type Fans } from '../polygons';
import { NumbersOfPoints } from './sharing';

/** Normals of points of which some have more than one, as they have at hard edges, or lean away from the faces around. */
export interface SplitNormals extends Fans {
  /** Point of each normal, and the next corner of the first face that has it. */
  readonly points: Uint32Array;
  readonly next: Uint32Array;
  /** Angles by which each leans away: along the edge to the next corner, and across. Null where none does. */
  readonly tilts: Float32Array | null;
}

/** How a normal leans away, as a corner has it. */
export interface Tilt {
  readonly next: number;
  readonly along: number;
  readonly across: number;
}

export class SplitVertices {
  private readonly vertices: NumbersOfPoints;
  private readonly points: number[] = [];
  private readonly uvs: number[] = [];
  private readonly uvNumbers: number[] = [];
  private readonly normalOf: number[] = [];
  private readonly normals: NumbersOfPoints;
  private readonly normalPoints: number[] = [];
  private readonly normalNumbers: number[] = [];
  private readonly tilts: Tilt[] = [];

  constructor(points: number) {
    this.vertices = new NumbersOfPoints(points);
    this.normals = new NumbersOfPoints(points);
  }

  /**
   * The vertex of a corner. Texture coordinates and normals are told apart by their numbers, those of one point.
   *
   * @param uv the texture coordinate with that number
   * @param tilt of the normal; that of the first corner counts
   */
  of(point: number, uvNumber: number, normalNumber: number, uv: readonly [number, number], tilt: Tilt): number {
    const normal = this.normal(point, normalNumber, tilt);
    let vertex = this.vertices.first(point);
    while (vertex !== undefined && (this.uvNumbers[vertex] !== uvNumber || this.normalOf[vertex] !== normal))
      vertex = this.vertices.next(vertex);
    if (vertex !== undefined) return vertex;
    this.points.push(point);
    this.uvs.push(...uv);
    this.uvNumbers.push(uvNumber);
    this.normalOf.push(normal);
    return this.vertices.add(point);
  }

  /** What was found, for triangles of three vertices each: point, texture coordinate and normal of each vertex. */
  finish(triangles: Uint32Array) {
    const [points, uvs] = [Uint32Array.from(this.points), Float32Array.from(this.uvs)];
    const tilts = Float32Array.from(this.tilts.flatMap(({ along, across }) => [along, across]));
    const isTilted = tilts.some((angle) => angle !== 0);
    if (!isTilted && new Set(this.normalPoints).size === this.normalPoints.length)
      return { points, uvs, normals: points, split: null };
    const normals = Uint32Array.from(this.normalOf);
    const corners = triangles.map((vertex) => points[vertex]);
    const owners = triangles.map((vertex) => normals[vertex]);
    const split: SplitNormals = {
      points: Uint32Array.from(this.normalPoints),
      next: Uint32Array.from(this.tilts, ({ next }) => next),
      tilts: isTilted ? tilts : null,
      ...fansOf(corners, owners, this.normalPoints.length),
    };
    return { points, uvs, normals, split };
  }

  private normal(point: number, number: number, tilt: Tilt): number {
    let normal = this.normals.first(point);
    while (normal !== undefined && this.normalNumbers[normal] !== number) normal = this.normals.next(normal);
    if (normal !== undefined) return normal;
    this.normalPoints.push(point);
    this.normalNumbers.push(number);
    this.tilts.push(tilt);
    return this.normals.add(point);
  }
}
