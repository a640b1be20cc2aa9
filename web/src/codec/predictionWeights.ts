/**
 * What predicts the position of a vertex at rest from those known before it: parallelograms, and the mean of its neighbours, each by a weight that is in the file;
 * docs/FORMAT.md, "Positions".
 */

/** Weights are counted in these parts; so are predictions before they are rounded. */
const PARTS = 32;
/** By how many parallelograms predict a vertex, these and more alike. */
const CLASSES = 3;
export const WEIGHTS_BYTES = 2 * CLASSES;

/** Of each class the weight of the parallelograms and that of the neighbours, as differences to the middle of the edges that the parallelograms lean on. */
export class PredictionWeights {
  private readonly weights: Int8Array;

  constructor(bytes: Uint8Array) {
    this.weights = Int8Array.from(bytes.subarray(0, WEIGHTS_BYTES));
  }

  /**
   * Where a coordinate is expected, in steps.
   *
   * @param count how many parallelograms predict it, 1 or more
   * @param edges the sum of the ends of their edges
   * @param far the sum of their far corners
   * @param known how many neighbours are known
   * @param neighbours the sum of these
   */
  expected(count: number, edges: number, far: number, known: number, neighbours: number): number {
    const middle = Math.floor(((PARTS / 2) * edges) / count);
    const parallelograms = Math.floor((PARTS * (edges - far)) / count);
    const around = known === 0 ? middle : Math.floor((PARTS * neighbours) / known);
    const at = 2 * (Math.min(count, CLASSES) - 1);
    const sum =
      PARTS * middle + this.weights[at] * (parallelograms - middle) + this.weights[at + 1] * (around - middle);
    return Math.floor((sum + (PARTS * PARTS) / 2) / (PARTS * PARTS));
  }
}
