/** How far the points of a decoded frame are from where they were captured, or from the surface that was observed. */
export interface PointErrors {
  /** Distance of each point as a fraction of the diagonal; NaN where a position is none. */
  readonly values: Float32Array;
  /** The point that is farthest away, and its distance. */
  readonly worst: number;
  readonly largest: number;
  /** What all but one in a hundred points stay below, rounded up by less than a thousandth of the largest distance. */
  readonly usual: number;
  /** Root mean square of the distances. */
  readonly l2: number;
}

/** Distances between two frames, x y z of each point, as fractions of `diagonal`. */
export function pointErrors(decoded: Float32Array, original: Float32Array, diagonal: number): PointErrors {
  const values = new Float32Array(decoded.length / 3);
  for (let point = 0; point < values.length; point++) {
    const k = 3 * point;
    const [x, y, z] = [decoded[k] - original[k], decoded[k + 1] - original[k + 1], decoded[k + 2] - original[k + 2]];
    values[point] = Math.sqrt(x * x + y * y + z * z) / diagonal;
  }
  return errorsOf(values);
}

/** What distances of points, as fractions of the diagonal, say together. */
export function errorsOf(values: Float32Array): PointErrors {
  let [worst, largest, squares, finite] = [0, 0, 0, 0];
  for (let point = 0; point < values.length; point++) {
    const distance = values[point];
    if (!Number.isFinite(distance)) continue;
    finite++;
    squares += distance * distance;
    if (distance <= largest) continue;
    largest = distance;
    worst = point;
  }
  return { values, worst, largest, usual: usualOf(values, largest), l2: Math.sqrt(squares / Math.max(1, finite)) };
}

const STEPS = 1024;
/** Part of the points that may be farther away than what is usual. */
const UNUSUAL = 0.01;

/** Counts values in steps: sorting those of a large model would take longer than drawing it. */
function usualOf(values: Float32Array, largest: number): number {
  if (largest === 0) return 0;
  const counts = new Uint32Array(STEPS + 1);
  for (const value of values) if (Number.isFinite(value)) counts[Math.floor((STEPS * value) / largest)]++;
  let beyond = 0;
  for (let step = STEPS; step > 0; step--) {
    beyond += counts[step];
    if (beyond > UNUSUAL * values.length) return Math.min(largest, ((step + 1) * largest) / STEPS);
  }
  return largest / STEPS;
}
