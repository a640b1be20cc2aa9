/** Of positions, x y z each, those between the 2nd and 98th percentile along every axis. */
export function mostOf(positions: Float32Array): Float32Array {
  const ends = [0, 1, 2].map((axis) => {
    const sorted = positions.filter((_, k) => k % 3 === axis).sort();
    const skipped = Math.floor(sorted.length / 50);
    return [sorted.at(skipped) ?? 0, sorted.at(-1 - skipped) ?? 0];
  });
  const isWithin = (value: number, axis: number) => value >= ends[axis][0] && value <= ends[axis][1];
  const isKept = (first: number) => [0, 1, 2].every((axis) => isWithin(positions[first + axis], axis));
  return positions.filter((_, k) => isKept(k - (k % 3)));
}
