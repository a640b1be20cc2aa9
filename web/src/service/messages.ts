/** The service's JSON bodies, as docs/openapi.json has them. Lengths are fractions of the rest pose's diagonal, times are seconds. */

import type { CoordinateSystem } from '../capture';
import { type ProblemDetails, problemFrom } from './problem';

export type SessionState = 'preparing' | 'ready' | 'completed' | 'failed';

/** A session; what preparing finds is null until it is done. */
export interface Session {
  readonly id: string;
  readonly name: string | null;
  readonly state: SessionState;
  /** Seconds since 1970. */
  readonly created: number;
  readonly points: number | null;
  readonly cage_vertices: number | null;
  readonly coordinates: CoordinateSystem;
  readonly frames: FrameCounts;
  /** Only of sessions whose frames are coded in groups. */
  readonly coding?: CodedFrames;
  readonly warnings: readonly string[];
  /** Why it failed; of a `ready` one, that its container is damaged, which completing it again writes anew. */
  readonly problem?: ProblemDetails;
}

/** How far the frames of a session are. */
export interface FrameCounts {
  readonly received: number;
  readonly solved: number;
  /** Ranges `[a, b)` below the highest frame that are not solved; the first ones. */
  readonly missing: readonly (readonly [number, number])[];
  /** Where the ranges begin that `missing` leaves out. */
  readonly missing_next?: number;
}

export interface CodedFrames {
  readonly group_frames: number | null;
  readonly frames: number;
  readonly bytes: number;
  readonly problem?: ProblemDetails;
}

export interface SessionPage {
  readonly sessions: readonly Session[];
  /** Where the next page begins; null on the last. */
  readonly next: string | null;
}

/** A solved frame; errors are null where only handle rows were sent. */
export interface FrameResult {
  readonly frame: number;
  readonly l2: number | null;
  readonly linf: number | null;
}

/** A cage that is designed from the motion of a capture. */
export interface CageDesign {
  readonly id: string;
  readonly state: 'queued' | 'running' | 'completed' | 'failed';
  readonly stage?: string | null;
  /** How much of it is done, 0 to 1. */
  readonly fraction: number;
  /** Vertices of the best cage so far; null before there is one. */
  readonly vertices?: number | null;
  /** Its mean L2 error on frames that the design does not see, as a fraction of the diagonal. */
  readonly error?: { readonly held_back?: number | null } | null;
  readonly problem?: ProblemDetails | null;
}

/** What a cage is to be; what is left out has the service's default. */
export interface DesignOptions {
  name?: string;
  vertices?: number;
  mean_error?: number;
  time_limit_s?: number;
}

/** A recovery, as far as the page shows it. */
export interface Recovery {
  readonly id: string;
  readonly name: string | null;
  readonly state: 'ready' | 'following' | 'finishing' | 'completed' | 'failed';
  readonly frames: { readonly received: number; readonly followed: number; readonly lost: number };
  readonly problem?: ProblemDetails;
}

/** A motion that is moved onto another model, as far as the page shows it. */
export interface Transfer {
  readonly name: string | null;
  readonly state: 'queued' | 'running' | 'completed' | 'failed';
  readonly frames: number;
  readonly moved: number;
  readonly problem?: ProblemDetails;
}

export interface SessionOptions {
  name?: string;
  coordinates?: CoordinateSystem;
  cage?: { vertices?: number; id?: string };
  frame_rate?: number;
  frames?: number;
  max_error?: number;
  quality?: 'preview' | 'standard' | 'master';
}

/** @throws ServiceProblem where the session failed; one that is `ready` goes on whatever its `problem` is */
export function throwIfFailed({ state, problem }: Session) {
  if (state === 'failed') throw problemFrom(problem ?? {});
}

/** Numbers of the frames below `end` that are not solved, as ranges `[a, b)`. */
export function unsolved(frames: FrameCounts, end: number): [number, number][] {
  const ranges = frames.missing.filter(([a]) => a < end).map(([a, b]): [number, number] => [a, Math.min(b, end)]);
  // Frames are the ones that are solved, the gaps between them, and those after the last one.
  const below = frames.missing_next ?? frames.solved + frames.missing.reduce((sum, [a, b]) => sum + b - a, 0);
  if (frames.missing_next === undefined && below < end) ranges.push([below, end]);
  return ranges;
}

/** How many frames from 0 on are solved without a gap. */
export function solvedFromStart(frames: FrameCounts): number {
  return frames.missing.length > 0 ? frames.missing[0][0] : frames.solved;
}
