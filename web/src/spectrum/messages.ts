import type { CoordinateSystem, TriangleMesh } from '../capture';
import type { Spectrum } from './singular';

/** What the page asks the worker for. */
export interface SpectrumRequest {
  readonly system: CoordinateSystem;
  readonly cage: TriangleMesh;
  /** Points of the model at rest, x y z each. */
  readonly rest: Float64Array;
  /** Columns of Φ that count, from the first on. */
  readonly rows: number;
  /** Φ, points × columns, where it comes from the service. */
  readonly phi: Float32Array | null;
}

/** What the worker answers: the part that is done, then the spectrum, or one sentence that says what failed. */
export type SpectrumAnswer =
  | { readonly kind: 'progress'; readonly fraction: number }
  | { readonly kind: 'spectrum'; readonly spectrum: Spectrum }
  | { readonly kind: 'failed'; readonly problem: string };
