import type { CoordinateSystem } from '../capture';

/** What the pool sends to a worker: first the cage, then slices of points. */
export type ToWorker =
  | {
      readonly kind: 'cage';
      readonly system: CoordinateSystem;
      readonly positions: Float64Array;
      readonly triangles: Uint32Array;
    }
  | { readonly kind: 'points'; readonly first: number; readonly points: Float64Array };

/** What a worker answers: rows of Φ of a slice, or one sentence that says what failed. */
export type FromWorker =
  | { readonly kind: 'rows'; readonly first: number; readonly rows: Float32Array }
  | { readonly kind: 'failed'; readonly problem: string };
