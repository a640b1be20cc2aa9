export type Vector = readonly [number, number, number];

export const sub = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** a + share · b. */
export const plus = (a: Vector, b: Vector, share = 1): Vector => [
  a[0] + share * b[0],
  a[1] + share * b[1],
  a[2] + share * b[2],
];
export const norm = (a: Vector): number => Math.sqrt(dot(a, a));
export const scaled = (a: Vector, factor: number): Vector => [a[0] * factor, a[1] * factor, a[2] * factor];
/** A vector of length 1; zero stays zero. */
export const normalized = (a: Vector): Vector => scaled(a, 1 / (norm(a) || 1));
export const cross = (a: Vector, b: Vector): Vector => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export function pointAt(positions: ArrayLike<number>, index: number): Vector {
  return [positions[3 * index], positions[3 * index + 1], positions[3 * index + 2]];
}

export function squaredDistanceToTriangle(a: Vector, b: Vector, c: Vector, x: Vector): number {
  const [u, v, w] = [sub(b, a), sub(c, a), sub(x, a)];
  const n = cross(u, v);
  const n2 = dot(n, n);
  const beta = dot(cross(w, v), n);
  const gamma = dot(cross(u, w), n);
  if (n2 > 0 && beta >= 0 && gamma >= 0 && beta + gamma <= n2) return dot(w, n) ** 2 / n2;
  return Math.min(
    squaredDistanceToSegment(a, b, x),
    squaredDistanceToSegment(b, c, x),
    squaredDistanceToSegment(c, a, x),
  );
}

function squaredDistanceToSegment(p: Vector, q: Vector, x: Vector): number {
  const [e, w] = [sub(q, p), sub(x, p)];
  const t = Math.min(1, Math.max(0, dot(w, e) / Math.max(dot(e, e), Number.MIN_VALUE)));
  const r = sub(w, scaled(e, t));
  return dot(r, r);
}
