/** Positions of a mesh at rest on a grid, predicted along its faces; docs/FORMAT.md, "Positions". */

import { CodedDataError } from './error';
import { IntegerModels, MAX_RESIDUAL_SIZE, MAX_SIZE, SIZE_CLASSES, sizeClass } from './integers';
import { parallelogramPredictions, type Predictions } from './parallelograms';
import { type Polygons, type ByVertex, adjacency } from './polygons';
import { PredictionWeights, WEIGHTS_BYTES } from './predictionWeights';
import { RangeDecoder } from './rangeDecoder';

/** Origin (three f64) and step (f64) of the grid. */
const GRID_BYTES = 32;
const HEAD_BYTES = GRID_BYTES + WEIGHTS_BYTES;

/**
 * Decodes the positions of so many points, x y z each, that the encoder wrote for the same faces in the same order. Damaged bytes may give positions that are
 * not finite.
 */
export function decodePositions(bytes: Uint8Array, faces: Polygons, points: number): Float64Array {
  if (bytes.length < HEAD_BYTES) throw new CodedDataError('positions are cut');
  const decoder = new RangeDecoder(bytes.subarray(HEAD_BYTES));
  const predictions = parallelogramPredictions(faces, points);
  const found = new Int32Array(3 * points);
  const weights = new PredictionWeights(bytes.subarray(GRID_BYTES, HEAD_BYTES));
  const predictor = new StepPredictor(weights, predictions, faces, points, found);
  readSteps(decoder, predictions, predictor, found);
  return onGrid(new DataView(bytes.buffer, bytes.byteOffset, GRID_BYTES), found);
}

function onGrid(grid: DataView, steps: Int32Array): Float64Array {
  const step = grid.getFloat64(24, true);
  const positions = new Float64Array(steps.length);
  for (let k = 0; k < 3; k++) {
    const origin = grid.getFloat64(8 * k, true);
    for (let at = k; at < positions.length; at += 3) positions[at] = Math.fround(origin + steps[at] * step);
  }
  return positions;
}

/** Reads the steps of all points to `found`, where the predictor finds those it needs. */
function readSteps(
  decoder: RangeDecoder,
  { order, starts, near }: Predictions,
  predictor: StepPredictor,
  found: Int32Array,
): void {
  const models = new IntegerModels(3 * SIZE_CLASSES);
  const sizes = new Uint32Array(3);
  for (let place = 0; place < order.length; place++) {
    const vertex = order[place];
    const count = starts[place + 1] - starts[place];
    predictor.begin(place);
    let sum = 0;
    for (let k = 0; k < 3; k++) {
      let expected = 0;
      if (count > 0) {
        expected = predictor.expected(k);
      } else if (near[place] !== vertex) {
        expected = found[3 * near[place] + k];
      }
      expected = Math.max(-MAX_SIZE, Math.min(MAX_SIZE, expected));
      const context = SIZE_CLASSES * Math.min(count, 2) + sizeClass(predictor.around(k, sum));
      const value = models.signed(decoder, context);
      found[3 * vertex + k] = value + expected;
      sizes[k] = Math.min(Math.abs(value), MAX_RESIDUAL_SIZE);
      sum += sizes[k];
    }
    predictor.end(sizes, sum);
  }
}

/** Predicts vertices, one after another, by parallelograms and neighbours, weighted. How far those of neighbours were off says how large a number will be. */
export class StepPredictor {
  private readonly neighbours: ByVertex;
  private readonly isKnown: Uint8Array;
  private readonly off: Uint32Array;
  private place = 0;
  private before = 0;
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
      if (this.isKnown[items[k]] === 1) this.known.push(items[k]);
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
    for (const w of this.known) sum += numbers[3 * w + axis];
    return sum;
  }
}
