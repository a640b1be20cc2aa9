import { Triangle, Vector3 } from 'three';
import { type ByVertex, byVertex } from '../codec/polygons';
import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';
import { UnusableFile } from '../files/frameSource';
import { extensionOf, objPoints } from '../files/meshes';

/** A surface, or a cloud of points where there are no triangles. */
export interface Surface {
  /** x y z of each point. */
  readonly points: Float32Array;
  readonly triangles: Uint32Array;
}

/** Points that a leaf of the tree has at the most. */
const LEAF = 8;

/** Finds how far places are from a surface: its nearest point is found in a k-d tree, then the triangles around that are looked at. */
export class NearestSurface {
  private readonly order: Uint32Array;
  private readonly around: ByVertex;
  private readonly triangle = new Triangle();
  private readonly spot = new Vector3();
  private nearest = 0;
  private best = 0;

  constructor(readonly surface: Surface) {
    const { points, triangles } = surface;
    const isFinite = (_: unknown, p: number) => Number.isFinite(points[3 * p] + points[3 * p + 1] + points[3 * p + 2]);
    this.order = Uint32Array.from({ length: points.length / 3 }, (_, p) => p).filter(isFinite);
    this.sort(0, this.order.length, 0);
    this.around = byVertex(triangles, 3, points.length / 3);
  }

  /** The distance from each place, x y z each; NaN where there is no surface. */
  distances(places: Float32Array): Float32Array {
    const found = new Float32Array(places.length / 3).fill(NaN);
    const { points, triangles } = this.surface;
    const { starts, items } = this.around;
    const place = new Vector3();
    if (this.order.length === 0) return found;
    for (let k = 0; k < found.length; k++) {
      place.fromArray(places, 3 * k);
      this.best = Infinity;
      this.search(place, 0, this.order.length, 0);
      for (let at = starts[this.nearest]; at < starts[this.nearest + 1]; at++) {
        const first = 3 * items[at];
        this.triangle.a.fromArray(points, 3 * triangles[first]);
        this.triangle.b.fromArray(points, 3 * triangles[first + 1]);
        this.triangle.c.fromArray(points, 3 * triangles[first + 2]);
        this.best = Math.min(this.best, this.triangle.closestPointToPoint(place, this.spot).distanceToSquared(place));
      }
      found[k] = Math.sqrt(this.best);
    }
    return found;
  }

  /** Puts the middle of each stretch of the order where it belongs by one axis, then does so with both halves by the next one. */
  private sort(begin: number, end: number, axis: number) {
    if (end - begin <= LEAF) return;
    const middle = (begin + end) >> 1;
    this.select(begin, end - 1, middle, axis);
    this.sort(begin, middle, (axis + 1) % 3);
    this.sort(middle + 1, end, (axis + 1) % 3);
  }

  /** Puts the point there that would be there if the stretch were sorted, smaller ones before and larger ones behind it (Hoare). */
  private select(low: number, high: number, wanted: number, axis: number) {
    const { order } = this;
    const { points } = this.surface;
    const value = (at: number) => points[3 * order[at] + axis];
    while (low < high) {
      const pivot = value((low + high) >> 1);
      let [i, j] = [low, high];
      while (i <= j) {
        while (value(i) < pivot) i++;
        while (value(j) > pivot) j--;
        if (i > j) break;
        const point = order[i];
        order[i++] = order[j];
        order[j--] = point;
      }
      if (wanted <= j) high = j;
      else if (wanted >= i) low = i;
      else return;
    }
  }

  private search(place: Vector3, begin: number, end: number, axis: number) {
    const { points } = this.surface;
    if (end - begin <= LEAF) {
      for (let at = begin; at < end; at++) this.look(place, this.order[at]);
      return;
    }
    const middle = (begin + end) >> 1;
    this.look(place, this.order[middle]);
    const beyond = place.getComponent(axis) - points[3 * this.order[middle] + axis];
    const next = (axis + 1) % 3;
    if (beyond < 0) this.search(place, begin, middle, next);
    else this.search(place, middle + 1, end, next);
    if (beyond * beyond >= this.best) return;
    if (beyond < 0) this.search(place, middle + 1, end, next);
    else this.search(place, begin, middle, next);
  }

  private look(place: Vector3, point: number) {
    const squared = place.distanceToSquared(this.spot.fromArray(this.surface.points, 3 * point));
    if (squared >= this.best) return;
    this.best = squared;
    this.nearest = point;
  }
}

/** Reads a mesh or a cloud of points (`.obj`, `.ply`). Throws one sentence for a person where it is neither. */
export async function readSurface(file: File): Promise<Surface> {
  if (extensionOf(file.name) === 'obj') {
    const points = await objPoints(file);
    return { points, triangles: objTriangles(await file.text(), points.length / 3) };
  }
  let geometry;
  try {
    geometry = new PLYLoader().parse(await file.arrayBuffer());
  } catch {
    throw new UnusableFile(file.name, 'this PLY file cannot be read.');
  }
  const points = geometry.getAttribute('position') as { array: Float32Array } | undefined;
  if (!points?.array.length) throw new UnusableFile(file.name, 'it has no points.');
  return { points: points.array, triangles: Uint32Array.from(geometry.index?.array ?? []) };
}

/** Faces of a Wavefront file, cut into fans; those with corners that are no points are left out. */
function objTriangles(text: string, points: number): Uint32Array {
  const triangles: number[] = [];
  let seen = 0;
  for (const [, kind, rest] of text.matchAll(/^[ \t]*([vf])[ \t]+(.+)$/gm)) {
    if (kind === 'v') {
      seen++;
      continue;
    }
    // Negative numbers count back from the points so far.
    const corners = rest.trim().split(/\s+/).map(parseFloat);
    const indices = corners.map((corner) => (corner < 0 ? seen + corner : corner - 1));
    if (!indices.every((index) => index >= 0 && index < points)) continue;
    for (let k = 2; k < indices.length; k++) triangles.push(indices[0], indices[k - 1], indices[k]);
  }
  return Uint32Array.from(triangles);
}
