const TAN_PI_8 = Math.SQRT2 - 1;

/**
 * The angle in [0, π] whose sine is `s` ≥ 0 and whose cosine is `c`, up to a common factor: `Math.atan2` to rounding, in a third of the time, which
 * is most of what coordinates take. The polynomial is the Chebyshev fit of `core/src/simd/angle.rs` for `atan(x)/x` on |x| ≤ tan(π/8).
 */
export function angle(s: number, c: number): number {
  const size = Math.abs(c);
  const small = s < size ? s : size;
  const big = s < size ? size : s;
  const folded = small > TAN_PI_8 * big;
  const x = folded ? (small - big) / (big + small) : small / big;
  const z = x * x;
  let sum = -0.017803896394812564;
  sum = sum * z + 0.03796390316111083;
  sum = sum * z - 0.05035049795312439;
  sum = sum * z + 0.05846866752275139;
  sum = sum * z - 0.06662950246036792;
  sum = sum * z + 0.07692045194561481;
  sum = sum * z - 0.09090896801472813;
  sum = sum * z + 0.11111110744657099;
  sum = sum * z - 0.14285714279244968;
  sum = sum * z + 0.19999999999940837;
  sum = sum * z - 0.3333333333333312;
  sum = sum * z + 1;
  const octant = folded ? x * sum + Math.PI / 4 : x * sum;
  const quadrant = s > size ? Math.PI / 2 - octant : octant;
  return c < 0 ? Math.PI - quadrant : quadrant;
}
