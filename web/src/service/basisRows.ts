/** Rows of Φ that a service computed, for the basis of coded cages. */

import type { StaticPart } from '../capture';
import { sampleStride } from '../codec/basis';
import type { CoordinatesOf } from '../container/blocks';
import type { Coordinates, Service } from './service';

/** Looks rows up in the Φ of session `id`, which the first look fetches. They are asked for in ascending order, some at a time. */
export function basisRows(service: Service, id: string, signal?: AbortSignal): CoordinatesOf {
  let held: Promise<Coordinates> | null = null;
  return async (part: StaticPart, _points: Float64Array, indices: Uint32Array) => {
    held ??= service.coordinates(id, undefined, signal);
    try {
      const { rows, columns, values } = await held;
      const points = part.rest.length / 3;
      if (rows !== points)
        throw new Error(`The service sent coordinates of ${rows} points, not ${points}. Reload the page.`);
      const found = new Float64Array(indices.length * columns);
      indices.forEach((row, k) => found.set(values.subarray(row * columns, (row + 1) * columns), k * columns));
      // Of a large model these are hundreds of megabytes, and after the last sample nobody asks again.
      if ((indices.at(-1) ?? points) + sampleStride(points) >= points) held = null;
      return found;
    } catch (error) {
      held = null;
      throw error;
    }
  };
}
