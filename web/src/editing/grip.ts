import { falloffWeights, type CageGraph, type FalloffMeasure } from './falloff';
import { displacement, mirrored, type Motion } from './motion';
import type { Vector } from '../coordinates/vector';
import type { Mirror } from './symmetry';

export interface GripSettings {
  /** In the capture's unit; 0 moves the chosen vertices alone. */
  readonly radius: number;
  readonly measure: FalloffMeasure;
  readonly mirror: Mirror | null;
}

/** Chosen vertices and all that follow them by falloff and symmetry. */
export interface Grip {
  readonly chosen: readonly number[];
  /** How much each vertex of the cage takes part, 0 to 1. */
  readonly own: Float64Array;
  /** The other side, where there is symmetry: the axis that it is mirrored along, the mirrored vertices, and how much each follows these. */
  readonly mirror: {
    readonly axis: 0 | 1 | 2;
    readonly chosen: readonly number[];
    readonly own: Float64Array;
  } | null;
}

/** Works out, once for a whole drag, what follows the chosen vertices. */
export function gripOf(graph: CageGraph, chosen: readonly number[], { radius, measure, mirror }: GripSettings): Grip {
  const own = falloffWeights(graph, chosen, radius, measure);
  const partners = mirror ? chosen.map((v) => mirror.partner[v]).filter((v) => v >= 0) : [];
  if (!mirror || partners.length === 0) return { chosen, own, mirror: null };
  const other = falloffWeights(graph, partners, radius, measure);
  // Edges of a symmetric cage need not be symmetric: pairs follow each other exactly all the same.
  mirror.partner.forEach((partner, v) => {
    if (partner >= 0) other[v] = own[partner];
  });
  return { chosen, own, mirror: { axis: mirror.axis, chosen: partners, own: other } };
}

/** How much of a motion each vertex takes part in, 0 to 1. */
export function weightsOf({ own, mirror }: Grip): Float64Array {
  return mirror ? own.map((weight, v) => Math.max(weight, mirror.own[v])) : own;
}

/**
 * Does a part of a motion, 0 to 1, to vertices of a frame, x y z each, in place. The pivot is the mean of the chosen vertices in that frame. Where both
 * sides of a symmetry reach, their mean counts, so that vertices on the plane of symmetry stay on it.
 */
export function displace(rows: Float64Array, grip: Grip, motion: Motion, part: number): void {
  const { own, mirror } = grip;
  const pivot = meanOf(rows, grip.chosen);
  const other = mirror && {
    weights: mirror.own,
    motion: mirrored(motion, mirror.axis),
    pivot: meanOf(rows, mirror.chosen),
  };
  for (let v = 0; v < own.length; v++) {
    const [a, b] = [own[v], other?.weights[v] ?? 0];
    if (a + b === 0) continue;
    const reach = part * Math.max(a, b);
    const arm = (from: Vector): Vector => [rows[3 * v] - from[0], rows[3 * v + 1] - from[1], rows[3 * v + 2] - from[2]];
    const here = a > 0 ? displacement(motion, reach, arm(pivot)) : null;
    const there = other && b > 0 ? displacement(other.motion, reach, arm(other.pivot)) : null;
    for (let k = 0; k < 3; k++) rows[3 * v + k] += (a * (here?.[k] ?? 0) + b * (there?.[k] ?? 0)) / (a + b);
  }
}

export function meanOf(positions: ArrayLike<number>, vertices: readonly number[]): Vector {
  const mean = (k: number) => vertices.reduce((sum, v) => sum + positions[3 * v + k], 0) / vertices.length;
  return [mean(0), mean(1), mean(2)];
}
