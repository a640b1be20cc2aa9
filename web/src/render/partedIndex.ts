/** Draws of triangles, edges or points those of some parts of the model. */

import { BufferAttribute, type BufferGeometry, type Material } from 'three';
import type { ModelPart } from '../capture';

/** What is drawn: with several materials it is drawn by the groups of its geometry. */
interface Drawn {
  material: Material | Material[];
}

export class PartedIndex {
  /** Where the vertices of each part begin in the index, and where the last one's end. */
  private readonly starts: Uint32Array;

  /**
   * Sorts the index of a geometry by the parts of the points that it names.
   *
   * @param size points of each triangle, edge or point
   */
  constructor(
    private readonly geometry: BufferGeometry,
    size: number,
    parts: readonly ModelPart[],
  ) {
    const index = geometry.index!.array as Uint32Array;
    const owners = partsOfPoints(parts);
    this.starts = new Uint32Array(parts.length + 1);
    for (let k = 0; k < index.length; k += size) this.starts[owners[index[k]] + 1] += size;
    for (let k = 0; k < parts.length; k++) this.starts[k + 1] += this.starts[k];
    const places = this.starts.slice();
    const sorted = new Uint32Array(index.length);
    for (let k = 0; k < index.length; k += size) {
      const part = owners[index[k]];
      for (let corner = 0; corner < size; corner++) sorted[places[part]++] = index[k + corner];
    }
    geometry.setIndex(new BufferAttribute(sorted, 1));
  }

  show(shown: readonly boolean[]) {
    const ranges = shown.map((_, part) => ({
      part,
      start: this.starts[part],
      count: this.starts[part + 1] - this.starts[part],
    }));
    showRanges(this.geometry, ranges, shown, () => 0);
  }
}

/** Has an object draw groups of its geometry. */
export function drawGroups(object: Drawn) {
  object.material = [object.material].flat();
}

/** Has a geometry draw the ranges of parts that are shown; those that follow one another and have one material are drawn at once. */
export function showRanges<R extends { readonly part: number; readonly start: number; readonly count: number }>(
  geometry: BufferGeometry,
  ranges: readonly R[],
  shown: readonly boolean[],
  materialOf: (range: R) => number,
) {
  geometry.clearGroups();
  for (const range of ranges) {
    if (!shown[range.part] || range.count === 0) continue;
    const material = materialOf(range);
    const last = geometry.groups.at(-1);
    if (last?.materialIndex === material && last.start + last.count === range.start) last.count += range.count;
    else geometry.addGroup(range.start, range.count, material);
  }
}

/** The part of each point. */
function partsOfPoints(parts: readonly ModelPart[]): Uint32Array {
  const owners = new Uint32Array(parts.reduce((sum, { points }) => sum + points, 0));
  parts.forEach(({ firstPoint, points }, part) => owners.fill(part, firstPoint, firstPoint + points));
  return owners;
}
