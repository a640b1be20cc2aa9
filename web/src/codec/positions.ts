/** Positions of a mesh at rest on a grid, predicted along its faces; docs/FORMAT.md, "Positions". */

import { CodedDataError } from './error';
import { IntegerModels, MAX_RESIDUAL_SIZE, MAX_SIZE, SIZE_CLASSES, sizeClass } from './integers';
import { parallelogramPredictions, type Predictions } from './parallelograms';
import type { Polygons } from './polygons';
import { PredictionWeights, WEIGHTS_BYTES } from './predictionWeights';
import { RangeDecoder } from './rangeDecoder';
import { StepPredictor } from './stepPredictor';

/** Origin (three f64) and step (f64) of the grid. */
const GRID_BYTES = 32;
const HEAD_BYTES = GRID_BYTES + WEIGHTS_BYTES;

/**
 * Decodes the positions of so many points, x y z each, that the encoder wrote for the same faces in the same order. Damaged bytes may give positions that are
 * not finite.
 */
export function decodePositions(bytes: Uint8Array, faces: Polygons, points: number): Float64Array {
  if (bytes.length < HEAD_BYTES) {
    throw new CodedDataError('positions are cut');
  }
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
    for (let at = k; at < positions.length; at += 3) {
      positions[at] = Math.fround(origin + steps[at] * step);
    }
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
