import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';
import { UnusableFile } from '../files/frameSource';
import { extensionOf, objPoints } from '../files/meshes';
import type { Surface } from './surface';

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
