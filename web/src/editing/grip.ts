import { falloffWeights, type CageGraph, type FalloffMeasure } from './falloff';
import type { Mirror } from './symmetry';

/** What follows when vertices are moved. */
export interface GripSettings {
  /** In the capture's unit; 0 moves the chosen vertices alone. */
  readonly radius: number;
  readonly measure: FalloffMeasure;
  readonly mirror: Mirror | null;
}

/** Chosen vertices and all that follow them: falloff and symmetry are worked out once for a whole drag. */
export class Grip {
  /** How much each vertex follows the movement, and how much the mirrored one. */
  private readonly own: Float64Array;
  private readonly mirrored: Float64Array | null;

  constructor(
    graph: CageGraph,
    chosen: readonly number[],
    private readonly settings: GripSettings,
  ) {
    const { radius, measure, mirror } = settings;
    this.own = falloffWeights(graph, chosen, radius, measure);
    const partners = mirror ? chosen.map((v) => mirror.partner[v]).filter((v) => v >= 0) : [];
    this.mirrored = partners.length > 0 ? falloffWeights(graph, partners, radius, measure) : null;
    // Edges of a symmetric cage need not be symmetric: pairs follow each other exactly all the same.
    mirror?.partner.forEach((other, v) => {
      if (this.mirrored && other >= 0) this.mirrored[v] = this.own[other];
    });
  }

  /** How much of the movement each vertex takes part in, 0 to 1. */
  get weights(): Float64Array {
    const { mirrored } = this;
    return mirrored ? this.own.map((weight, v) => Math.max(weight, mirrored[v])) : this.own;
  }

  /**
   * Displacement of each vertex, x y z, when the chosen ones move by `by`. Where both sides reach, their mean counts, so that vertices on the plane of
   * symmetry stay on it.
   */
  offsets(by: readonly [number, number, number]): Float64Array {
    const { own, mirrored } = this;
    const axis = this.settings.mirror?.axis;
    const offsets = new Float64Array(3 * own.length);
    for (let v = 0; v < own.length; v++) {
      const [a, b] = [own[v], mirrored?.[v] ?? 0];
      if (a + b === 0) continue;
      const along = Math.max(a, b);
      const across = (along * (a - b)) / (a + b);
      for (let k = 0; k < 3; k++) offsets[3 * v + k] = (k === axis ? across : along) * by[k];
    }
    return offsets;
  }
}
