/** What positions on a grid are expected to be, and how far off that was around them. */

import { adjacency } from './adjacency';
import type { ByVertex } from './byVertex';
import type { Predictions } from './parallelograms';
import type { Polygons } from './polygons';
import type { PredictionWeights } from './predictionWeights';

/** Predicts vertices, one after another, by parallelograms and neighbours, weighted. How far those of neighbours were off says how large a number will be. */
export class StepPredictor {
  private readonly neighbours: ByVertex;
  private readonly isKnown: Uint8Array;
  private readonly off: Uint32Array;
  private place = 0;
  private before = 0;
  /** Neighbours that are known. */
  private known: number[] = [];

  constructor(
    private readonly weights: PredictionWeights,
    private readonly predictions: Predictions,
    faces: Polygons,
    points: number,
    private readonly found: Int32Array,
  ) {
    this.neighbours = adjacency(faces, points);
    this.isKnown = new Uint8Array(points);
    this.off = new Uint32Array(3 * points);
  }

  /** Turns to the next vertex. */
  begin(place: number): void {
    this.place = place;
    this.known = [];
    const { starts, items } = this.neighbours;
    const vertex = this.predictions.order[place];
    for (let k = starts[vertex]; k < starts[vertex + 1]; k++) {
      if (this.isKnown[items[k]] === 1) {
        this.known.push(items[k]);
      }
    }
  }

  /** What is expected of a coordinate of that vertex, x, y, z being 0, 1, 2; one parallelogram predicts it at least. */
  expected(axis: number): number {
    const { starts, triples } = this.predictions;
    const { found, known } = this;
    const [start, end] = [starts[this.place], starts[this.place + 1]];
    let edges = 0;
    let far = 0;
    for (let t = 3 * start; t < 3 * end; t += 3) {
      edges += found[3 * triples[t] + axis] + found[3 * triples[t + 1] + axis];
      far += found[3 * triples[t + 2] + axis];
    }
    return this.weights.expected(end - start, edges, far, known.length, this.sumOfKnown(found, axis));
  }

  /** How far off vertices around it were, in sixteenths. */
  around(axis: number, soFar: number): number {
    const mean = Math.floor((6 * this.sumOfKnown(this.off, axis)) / Math.max(this.known.length, 1));
    return mean + 5 * (this.before >> 3) + 5 * soFar;
  }

  /** Takes how far off it was, in each coordinate and in all. */
  end(sizes: Uint32Array, sum: number): void {
    const vertex = this.predictions.order[this.place];
    this.isKnown[vertex] = 1;
    this.off.set(sizes, 3 * vertex);
    this.before = (this.before + Math.floor((8 * sum) / 3)) >> 1;
  }

  private sumOfKnown(numbers: Int32Array | Uint32Array, axis: number): number {
    let sum = 0;
    for (const w of this.known) {
      sum += numbers[3 * w + axis];
    }
    return sum;
  }
}
