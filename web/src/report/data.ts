/** What `cager compare`, `demo` and `cage` write into the page: `src/report_page` and `src/compare` of the program define it. */

import type { Quantised } from './geometry/numbers';

/** JSON has no number for what does not exist. */
export type Figure = number | null;

export type Report =
  | { readonly kind: 'comparison'; readonly program: string; figures: Comparison; geometry: ComparisonGeometry }
  | { readonly kind: 'demo'; readonly program: string; figures: DemoFigures; geometry: DemoGeometry }
  | { readonly kind: 'cage'; readonly program: string; figures: CageFigures; geometry: CageGeometry };

/** A model at rest in its cage; of a large model some points. */
export interface ModelInCage {
  readonly mesh: {
    readonly of: number;
    readonly diagonal: number;
    readonly up: 'x' | 'y' | 'z';
    readonly points: Quantised;
    readonly triangles: string;
  };
  readonly cage: { readonly vertices: string; readonly triangles: string };
}

export interface ComparisonGeometry extends ModelInCage {
  readonly frames: readonly { readonly frame: number; readonly points: Quantised }[];
  /** Frames of the methods' cages. */
  readonly clip: readonly number[];
  readonly systems: readonly SystemGeometry[];
}

export interface SystemGeometry {
  readonly handles: string;
  readonly methods: readonly {
    readonly method: number;
    readonly cages: Quantised;
    readonly offsets: Quantised;
  }[];
  readonly draw: {
    readonly name: string;
    readonly l2: Figure;
    readonly linf: Figure;
    readonly offsets: Quantised;
  } | null;
  readonly row: readonly { readonly frame: number; readonly cage: Quantised; readonly offsets: Quantised }[];
  readonly vectors: readonly string[];
}

/** Figures of a comparison; lengths are fractions of the rest pose's diagonal. */
export interface Comparison {
  readonly capture: {
    readonly rest: string;
    readonly cage: string;
    readonly flip_cage: boolean;
    readonly source: string;
    readonly points: number;
    readonly triangles: number;
    readonly cage_vertices: number;
    readonly cage_faces: number;
    readonly frames: number;
    readonly measured: readonly number[];
    readonly diagonal: number;
    readonly motion_mean: Figure;
    readonly motion_max: Figure;
    readonly shown: number;
    readonly noise_radius: number;
  };
  readonly systems: readonly {
    readonly name: string;
    readonly refused: string | null;
    readonly figures: SystemFigures | null;
  }[];
  readonly recommendation: {
    readonly editing: Choice | null;
    readonly accuracy: Choice | null;
    readonly accurate: number;
  };
  readonly claims: readonly Claim[];
}

export interface Choice {
  readonly system: string;
  readonly method: string;
  readonly flags: string;
  readonly l2_mean: Figure;
  readonly smoothness: Figure;
  readonly smoothness_of: 'second-difference' | 'edges';
}

export interface Claim {
  readonly system: string;
  readonly statement: string;
  readonly source: string;
  readonly measured: string;
  readonly verdict: 'holds' | 'in-part' | 'fails';
}

export interface SystemFigures {
  readonly unknowns: number;
  readonly rank: number;
  readonly spectra: {
    readonly handles: readonly Figure[];
    readonly full: readonly Figure[];
    readonly condition_handles: Figure;
    readonly condition_full: Figure;
    readonly condition_normal: Figure;
  };
  readonly swaps: { readonly from_lu: SwapTrace; readonly from_random: SwapTrace | null };
  readonly random: readonly Draw[];
  readonly methods: readonly MethodFigures[];
  readonly noise: readonly NoiseFigures[];
  readonly vectors: { readonly spread: readonly Figure[]; readonly painted: readonly number[] };
  readonly seconds: {
    readonly coordinates: Figure;
    readonly maxvol: Figure;
    readonly svd: Figure;
    readonly per_frame: Figure;
  };
}

export interface SwapTrace {
  readonly points: number;
  readonly log_volume: readonly Figure[];
  readonly after: readonly number[];
  readonly condition: readonly Figure[];
}

export interface Draw {
  readonly choice: string;
  readonly rank: number;
  readonly condition: Figure;
  readonly data_alone: Totals;
  readonly totals: Totals;
}

/** A way to invert, as `cager encode` names its options. */
export interface Method {
  readonly name: string;
  readonly handles: string;
  readonly regularizer: string;
  readonly spectrum: number;
  /** Whether charts over frames and views show it. */
  readonly curve: boolean;
}

export interface MethodFigures extends Method {
  readonly totals: Totals;
  readonly per_frame: PerFrame;
  readonly frame_seconds: Figure;
}

export interface NoiseFigures extends Method {
  readonly totals: Totals;
  readonly per_frame: PerFrame;
  readonly clean_l2_mean: Figure;
}

export type Totals = Readonly<Record<`${'l2' | 'linf' | 'spike' | 'edges'}_${'mean' | 'max'}`, Figure>>;

/** A number for each measured frame. */
export type PerFrame = Readonly<
  Record<'l2' | 'linf' | 'spike_mean' | 'spike_max' | 'edges_mean' | 'edges_max', readonly Figure[]>
>;

export interface DemoFigures {
  readonly rows: readonly { readonly name: string; readonly value: string; readonly note: string }[];
  readonly l2: readonly Figure[];
  readonly linf: readonly Figure[];
  readonly singular_values: readonly Figure[];
}

export interface DemoGeometry extends ModelInCage {
  readonly frames: readonly number[];
  readonly points: Quantised;
  readonly cages: Quantised;
}

export interface CageGeometry extends ModelInCage {
  readonly name: string | null;
}

/** Reports of a cage that was made, or that was checked, differ in what they count. */
export interface CageFigures {
  readonly vertices: number;
  readonly faces: number;
  readonly design?: {
    readonly style: string;
    readonly frames: number;
    /** In stretches of time that neither the design nor its choice saw, and the error there. */
    readonly unseen_frames?: number;
    readonly unseen_error?: Figure;
    readonly stages: readonly {
      readonly name: string;
      readonly vertices: number;
      readonly designed_error: Figure;
      readonly held_back_error: Figure;
      readonly condition_number?: Figure;
      readonly seconds: Figure;
    }[];
  };
  readonly findings?: readonly string[];
  readonly changes?: readonly string[];
  readonly warnings?: readonly string[];
  readonly [count: string]: unknown;
}

/** The report that the program wrote into the page; null in a page that holds none. */
export function readReport(page: Document): Report | null {
  const text = page.getElementById('report')?.textContent ?? '';
  return text.trim() === '' ? null : (JSON.parse(text) as Report);
}
