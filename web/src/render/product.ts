/** Values of all columns of Φ, one array for each axis. */
export type ColumnValues = readonly [Float64Array, Float64Array, Float64Array];

/**
 * P = Φ·C on the processor: `phi` is points × columns, `out` gets x y z and one unused number of each point. Where no graphics processor does the
 * work, this takes a quarter of the time of a shader.
 */
export function multiply(phi: Float32Array, [x, y, z]: ColumnValues, out: Float32Array) {
  const columns = x.length;
  const points = phi.length / columns;
  let point = 0;
  // Two points at a time share what is read of the cage, and their sums do not wait for each other.
  for (; point + 1 < points; point += 2) {
    const first = point * columns;
    const second = first + columns;
    let [ax, ay, az, bx, by, bz] = [0, 0, 0, 0, 0, 0];
    for (let column = 0; column < columns; column++) {
      const a = phi[first + column];
      const b = phi[second + column];
      const cx = x[column];
      const cy = y[column];
      const cz = z[column];
      ax += a * cx;
      ay += a * cy;
      az += a * cz;
      bx += b * cx;
      by += b * cy;
      bz += b * cz;
    }
    const at = 4 * point;
    out[at] = ax;
    out[at + 1] = ay;
    out[at + 2] = az;
    out[at + 4] = bx;
    out[at + 5] = by;
    out[at + 6] = bz;
  }
  if (point === points) return;
  for (const [k, values] of [x, y, z].entries()) {
    out[4 * point + k] = values.reduce((sum, value, column) => sum + phi[point * columns + column] * value, 0);
  }
}
