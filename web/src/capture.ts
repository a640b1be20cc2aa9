/** What the parts of the page hand to each other: a capture's static part, and its frames as they come. */

import type { SplitMesh } from './codec/surface/splitMesh';
import type { Source } from './container/source';

/** Coordinate systems a container can name; docs/FORMAT.md defines them. */
export type CoordinateSystem = 'mvc' | 'harmonic' | 'green' | 'green-free';

export type UpAxis = 'y' | 'z';

/** A closed mesh of triangles. */
export interface TriangleMesh {
  /** x y z of each vertex. */
  readonly positions: Float64Array;
  /** Three vertex indices of each triangle, counter-clockwise from outside. */
  readonly triangles: Uint32Array;
}

/** Consecutive points of a model, from those of the carrier before, and the vertices of the component of its cage that carries them. */
export interface Carrier {
  readonly points: number;
  readonly firstVertex: number;
  readonly vertices: number;
}

/** A cage: a closed mesh, each of whose components may carry some of the points of the model alone (`COMP` in docs/FORMAT.md). */
export interface Cage extends TriangleMesh {
  readonly carriers?: readonly Carrier[];
}

/** Everything that does not change from frame to frame. */
export interface StaticPart {
  readonly system: CoordinateSystem;
  /**
   * What is to be added to all positions of a capture that lies far away (`ORIG` in docs/FORMAT.md); the page shows it without. What it writes are containers, which
   * keep it.
   */
  readonly origin?: Float64Array;
  /** Points of the model at rest, x y z each. */
  readonly rest: Float64Array;
  /** Number of corners of each polygon of the model; empty for a point cloud. */
  readonly cornerCounts: Uint32Array;
  /** Point indices of all corners, polygon by polygon. */
  readonly corners: Uint32Array;
  /** Red, green and blue of each point of the model, in sRGB, where the file has them (`rcol` in docs/FORMAT.md). */
  readonly colors?: Uint8Array;
  readonly cage: Cage;
  /** Rows of three numbers of one frame: what the coordinate system's columns multiply. */
  readonly rowsPerFrame: number;
  /** Frames per second, if the file or session says. */
  readonly frameRate: number | null;
  /** Figures about the encoding (`Report` in proto/src/report.rs), as far as known. */
  readonly report: Readonly<Record<string, unknown>> | null;
  /** The axis that points up, where the file or whoever wrote it said so (`unit` in docs/FORMAT.md). */
  readonly up?: UpAxis;
  /** Boundary elements that harmonic coordinates were solved on (`ELEM` in docs/FORMAT.md), where the file has them. */
  readonly elements?: Uint8Array;
}

/** One mesh of a scene: a part of the model. */
export interface ModelPart {
  /** Names from the root of the scene down to the mesh with `/` between them. */
  readonly path: string;
  readonly firstPoint: number;
  readonly points: number;
  /** From which frame to which it is shown, the last one not included; null where it always is. */
  readonly shown: readonly (readonly [start: number, end: number])[] | null;
}

/** What pictures say of a material, as far as it is drawn. */
export type TextureChannel = 'base_color' | 'opacity' | 'roughness' | 'metalness';

export interface Texture {
  readonly channel: TextureChannel;
  /** Its file as the source names it. */
  readonly path: string;
}

/** What a surface looks like. Pictures stand in place of the numbers. */
export interface Material {
  readonly name: string;
  /** Linear red, green and blue. */
  readonly baseColor: readonly [number, number, number];
  readonly opacity: number;
  readonly roughness: number;
  readonly metalness: number;
  readonly textures: readonly Texture[];
}

/** What lies on the faces of the model (`surf` in docs/FORMAT.md), as far as it is drawn. */
export interface ModelSurface {
  readonly parts: readonly ModelPart[];
  readonly materials: readonly Material[];
  readonly mesh: SplitMesh;
}

/** Frames that follow one another, decoded from what a file or a service sent. */
export interface FrameBlock {
  /** Number of the first frame, counted from 0. */
  readonly first: number;
  readonly count: number;
  /** Rows of all frames, `count × rowsPerFrame × 3`. */
  readonly cages: Float32Array;
  /** What is added to the positions decoded from the cages, where the block has a residual layer. */
  readonly residual: Residual | null;
  /** Whether these are cages as they were solved, of frames that are still to be coded: {@link Capture.hasFinal} says when they are. */
  readonly isPreliminary?: boolean;
}

/**
 * A block's residual: frame k of the block adds `Σ_r trajectories[k·rank + r] · shapes[(r·points + p)·3 + axis]` to every point p, then
 * the corrections of that frame.
 */
export interface Residual {
  readonly rank: number;
  /** `count × rank`. */
  readonly trajectories: Float32Array;
  /** `rank × points × 3`. */
  readonly shapes: Float32Array;
  /** Frame k corrects `correctedPoints[correctionStarts[k] … correctionStarts[k + 1])`. */
  readonly correctionStarts: Uint32Array;
  readonly correctedPoints: Uint32Array;
  /** x y z for each of `correctedPoints`. */
  readonly correctionVectors: Float32Array;
}

/** Changes of some cage vertices over a range of frames, added to the cages as they were encoded (`EDIT` in docs/FORMAT.md). */
export interface EditLayer {
  readonly name: string;
  readonly isOn: boolean;
  readonly first: number;
  readonly count: number;
  /** Vertices of the cage, ascending. */
  readonly vertices: Uint32Array;
  /** What is added, x y z of each vertex in each frame: `count × vertices × 3`. */
  readonly offsets: Float32Array<ArrayBuffer>;
}

/** Errors of frames as fractions of the rest pose's diagonal; NaN where not measured. */
export interface FrameErrors {
  readonly l2: Float32Array;
  readonly linf: Float32Array;
}

/** How the frames of a recovery were found, as its report tells; frames by their place in the capture. */
export interface Tracking {
  /** How well the template lies on the surface, as a fraction of its diagonal: less is better. NaN where there was no surface. */
  readonly scores: Float32Array;
  /** `followed`, found by a `wider_search`, `lost`, or `no_surface`. */
  readonly outcomes: readonly string[];
  /** Names of the files with the surfaces. */
  readonly files: readonly string[];
}

/** How the frames of a session that is still running arrive. */
export interface LiveStatus {
  /**
   * `following`: connected. `reconnecting`: broken, tried again at `retryAt`. `signed-out`: waits for a token. `ended`: nothing follows any more,
   * since the session is completed or gone.
   */
  readonly state: 'following' | 'reconnecting' | 'signed-out' | 'ended';
  /** When it is tried again, in milliseconds as of `Date.now()`; null while nothing is broken. */
  readonly retryAt: number | null;
  /** Seconds from a frame's being solved to its being here, within half a round trip; null before it was measured. */
  readonly latencySeconds: number | null;
  /** The first frame that later ones wait for, as it has not come to the service; null where none is missing. */
  readonly missingFrame: number | null;
  /** How many frames are compressed, from the first on; null where frames are kept as they were solved. */
  readonly codedFrames: number | null;
  /** Frames that are solved and not here yet. */
  readonly behindFrames: number;
  /** Bits and frames that arrived in the last seconds, per second. */
  readonly bitsPerSecond: number;
  readonly framesPerSecond: number;
  /** Frames that somebody had to wait for. */
  readonly lateFrames: number;
  /** Frames passed over because the connection was too slow for all of them, or thrown away because they were damaged; each is fetched when it is looked at. */
  readonly droppedFrames: number;
}

/** A capture that is being looked at, from a file, a finished session or one that is still running. */
export interface Capture {
  readonly name: string;
  session?: string;
  /** The same whenever this capture is opened; what the browser keeps of it is found by this. */
  identity?: string;
  readonly static: StaticPart;
  /** Number of frames known so far. */
  readonly frames: number;
  /** Bytes that all frames take in the container, residuals included, where these are known. */
  readonly frameBytes?: number | undefined;
  /** Whether no more frames will come. */
  readonly complete: boolean;
  /** Errors of the frames known so far; may be shorter than `frames`. */
  readonly errors: FrameErrors;
  /** For each point the one of the source that corresponds, of a motion that was moved here and whose report is there. */
  correspondence?: readonly number[] | null;
  /** How its frames were found, of a recovery whose report is there. */
  tracking?: Tracking;
  /** Number where each frame comes from, or null if these count from 0 as frames do. */
  readonly frameNumbers: Float64Array | null;
  /** The block that has frame `frame`; waits for frames that are still to come where the capture is not complete. */
  block(frame: number, signal?: AbortSignal): Promise<FrameBlock>;
  /** Whether {@link block} gives a frame as it was coded from now on, where it was preliminary before; fires `change` when that may differ. */
  hasFinal?(frame: number): boolean;
  /** Parts and materials of the model, where the file has any. */
  surface?(signal?: AbortSignal): Promise<ModelSurface | null>;
  /** Files of the pictures that the materials name, by their paths, as far as the file has them. */
  pictures?(signal?: AbortSignal): Promise<ReadonlyMap<string, Uint8Array<ArrayBuffer>>>;
  /** Φ, points × columns, from the service; for coordinate systems that the page does not compute itself. */
  coordinates?(onProgress?: (fraction: number) => void, signal?: AbortSignal): Promise<Float32Array>;
  /** Φ, points × columns, where decoding cages computes it anyway. */
  phi?(onProgress: (fraction: number) => void, signal: AbortSignal): Promise<Float32Array>;
  /** Point numbers of the handles, where they are known. */
  handles?(signal?: AbortSignal): Promise<Uint32Array>;
  /** Edits that its file has; {@link block} gives frames with those that are on. */
  readonly layers?: readonly EditLayer[];
  /** Takes some of the layers away, or switches them; fires `replaced`. The file stays as it is. */
  setLayers?(layers: readonly EditLayer[]): void;
  /** The container that holds the capture, for copies of it with edited cages. */
  container?(signal?: AbortSignal): Promise<Source>;
  /** Positions of some cages, decoded by the service: for each `rowsPerFrame × 3` floats of the body, points × 3. */
  decode?(cages: Blob, signal?: AbortSignal): Promise<Response>;
  /** What a service saves the capture as: the programs by the endings of files for them, its container beside these. */
  downloads?: {
    readonly formats: Readonly<Record<string, string>>;
    readonly save: (ending: string, name: string, onProgress: (part: number) => void) => Promise<void>;
  };
  /** How frames arrive, of a session that was running when it was opened. */
  readonly live?: LiveStatus | null;
  /** The frames that are read together with this one, and fail together with it; the frame alone where that is not known. */
  readTogether?(frame: number): { readonly first: number; readonly count: number };
  /**
   * Fires `change` when frames arrive, the state changes or something fails (`problem` then says what), and `replaced` when blocks come from another
   * source from now on: those that were given out before are not to be mixed with them.
   */
  readonly events: EventTarget;
  readonly problem: string | null;
  close(): void;
}
