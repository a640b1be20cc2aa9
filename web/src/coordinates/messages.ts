import type { Cage, CoordinateSystem } from '../capture';

/** What the pool sends to a worker: first the cage, then slices of points. */
export type ToWorker =
  | {
      readonly kind: 'cage';
      readonly system: CoordinateSystem;
      readonly cage: Cage;
      /** Whether rows are to come in double precision. */
      readonly isExact: boolean;
    }
  | {
      readonly kind: 'points';
      readonly slice: number;
      /** Place of the first of these points among those of the model. */
      readonly first: number;
      readonly points: Float64Array;
    };

/** What a worker answers: rows of Φ of a slice, or one sentence that says what failed. */
export type FromWorker =
  | { readonly kind: 'rows'; readonly slice: number; readonly rows: Float32Array | Float64Array }
  | { readonly kind: 'failed'; readonly problem: string };
