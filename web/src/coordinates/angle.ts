const TAN_PI_8 = Math.SQRT2 - 1;

/**
 * The angle in [0, π] whose sine is `s` ≥ 0 and whose cosine is `c`, up to a common factor: `Math.atan2` to rounding, in a third of the time, which
 * is most of what coordinates take. The polynomial is the Chebyshev fit of `crates/core/src/simd/angle.rs` for `atan(x)/x` on |x| ≤ tan(π/8).
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

/** Cosine of the largest angle that {@link halfAngleOverSine} takes, 22.5°. */
export const SMALL_ANGLE_COSINE = 0.9238795325112867;

/**
 * Half of an angle over its sine, from the square of the sine: of edges that are seen from far away, which most are, in a fraction of the time that
 * {@link angle} takes. The polynomial is the Chebyshev fit of `asin(√q) / 2√q` on q ≤ sin²(π/8), exact to rounding.
 */
export function halfAngleOverSine(q: number): number {
  const q2 = q * q;
  const q4 = q2 * q2;
  const low = 0.5 + 0.08333333333343058 * q + (0.037499999978157096 + 0.02232143046886408 * q) * q2;
  const middle = 0.015190888819892757 + 0.01118817494467486 * q + (0.008644566583484658 + 0.00727774766412015 * q) * q2;
  return low + (middle + (0.0041588330265271015 + 0.009491662608525695 * q) * q4) * q4;
}
