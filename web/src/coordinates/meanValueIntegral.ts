import { cross, dot, squaredDistanceToTriangle, sub, type Vector } from './vector';

/** Nodes and weights of Gauss's rule with eight points on [0, 1], exact to degree 15. */
const GAUSS: readonly (readonly [number, number])[] = [
  [0.019855071751231884, 0.05061426814518813],
  [0.10166676129318664, 0.11119051722668724],
  [0.2372337950418355, 0.15685332293894363],
  [0.4082826787521751, 0.181341891689181],
  [0.591717321247825, 0.181341891689181],
  [0.7627662049581645, 0.15685332293894363],
  [0.8983332387068134, 0.11119051722668724],
  [0.9801449282487681, 0.05061426814518813],
];
/** Pieces are halved until their longest side is at most this fraction of their distance: the rule is then exact to rounding. */
const SIDE_OVER_DISTANCE = 0.35;
/** Halvings at most; a longest side is halved by every second one. */
const MAX_HALVINGS = 120;

type Triangle = readonly [Vector, Vector, Vector];

/**
 * Mean value weights of a triangle's corners for the point `x` as the integrals that define them (Ju, Schaefer and Warren 2005),
 * `w_i = h ∫ λ_i / |r|⁴ dA` with h the height of the plane over the point: the integrands have one sign, so that nothing cancels where the
 * triangle is seen edge-on or from far away.
 */
export function integratedWeights(corners: Triangle, x: Vector): Vector {
  const sides = sidesOf(corners);
  // The product of the two shortest sides rounds least.
  const longest = longestOf(sides);
  const normal = cross(sides[(longest + 1) % 3], sides[(longest + 2) % 3]);
  const seen: Triangle = [sub(corners[0], x), sub(corners[1], x), sub(corners[2], x)];
  const sums: [number, number, number] = [0, 0, 0];
  const unit: Triangle = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ];
  addPiece(seen, unit, 1, MAX_HALVINGS, sums);
  const height = dot(seen[longest], normal);
  return [sums[0] * height, sums[1] * height, sums[2] * height];
}

/** Adds `∫ λ_i / |r|⁴ dA` over a piece with these corners and barycentric coordinates; `share` is its part of the triangle, whose area counts as ½. */
function addPiece(
  corners: Triangle,
  barycentric: Triangle,
  share: number,
  halvings: number,
  sums: [number, number, number],
) {
  const sides = sidesOf(corners);
  const top = longestOf(sides);
  const reach2 = squaredDistanceToTriangle(...corners, [0, 0, 0]) * SIDE_OVER_DISTANCE ** 2;
  if (halvings > 0 && dot(sides[top], sides[top]) > reach2) {
    const [i, j] = [(top + 1) % 3, (top + 2) % 3];
    const middle = midpoint(corners[i], corners[j]);
    const middleBarycentric = midpoint(barycentric[i], barycentric[j]);
    for (const replaced of [i, j]) {
      const half = replacedCorner(corners, replaced, middle);
      addPiece(half, replacedCorner(barycentric, replaced, middleBarycentric), 0.5 * share, halvings - 1, sums);
    }
    return;
  }
  // Collapsed coordinates: y = a + u (b − a) + u v (c − b), dA = 2 area · u du dv.
  const a = corners[0];
  const [bc, , ab] = sides;
  let [first, second, third] = [0, 0, 0];
  for (const [u, weightU] of GAUSS) {
    const start: Vector = [a[0] + u * ab[0], a[1] + u * ab[1], a[2] + u * ab[2]];
    for (const [v, weightV] of GAUSS) {
      const r: Vector = [start[0] + u * v * bc[0], start[1] + u * v * bc[1], start[2] + u * v * bc[2]];
      const r2 = dot(r, r);
      const value = (weightU * weightV * u) / (r2 * r2);
      first += value * (1 - u);
      second += value * u * (1 - v);
      third += value * u * v;
    }
  }
  for (let i = 0; i < 3; i++) {
    sums[i] += share * (first * barycentric[0][i] + second * barycentric[1][i] + third * barycentric[2][i]);
  }
}

function sidesOf([a, b, c]: Triangle): Triangle {
  return [sub(c, b), sub(a, c), sub(b, a)];
}

function longestOf(sides: Triangle): number {
  let best = 0;
  for (let i = 1; i < 3; i++) if (dot(sides[i], sides[i]) > dot(sides[best], sides[best])) best = i;
  return best;
}

function midpoint(a: Vector, b: Vector): Vector {
  return [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])];
}

function replacedCorner(triangle: Triangle, corner: number, by: Vector): Triangle {
  return [corner === 0 ? by : triangle[0], corner === 1 ? by : triangle[1], corner === 2 ? by : triangle[2]];
}
