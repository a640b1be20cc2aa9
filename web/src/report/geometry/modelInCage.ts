import type { TriangleMesh } from '../../capture';
import { middleOf } from '../../coordinates/topology';
import type { ModelInCage } from '../data';
import { coordinates, floats, indices, type Quantised } from './numbers';

/** Scene axes, y up, from those of a capture: signed axis numbers, counted from 1. */
const UPRIGHT = { x: [3, 1, 2], y: [1, 2, 3], z: [1, 3, -2] } as const;

/** The rest pose in its cage as it is drawn: y up, lengths in diagonals, the middle of the rest pose at the origin. */
export class RestPose {
  /** x y z of each point. */
  readonly points: Float32Array;
  readonly triangles: Uint32Array;
  readonly cage: TriangleMesh;
  /** x y z of each vertex of the cage. */
  readonly cageVertices: Float32Array;
  private readonly middle: readonly number[];

  constructor(private readonly from: ModelInCage) {
    const points = coordinates(from.mesh.points);
    this.middle = middleOf(points);
    this.points = this.placed(points);
    this.triangles = indices(from.mesh.triangles, points.length / 3);
    const vertices = floats(from.cage.vertices);
    this.cageVertices = this.placed(vertices);
    this.cage = {
      positions: Float64Array.from(this.cageVertices),
      triangles: indices(from.cage.triangles, vertices.length / 3),
    };
  }

  /** Positions of the capture, in its unit, as positions of the scene. */
  placed(positions: Float32Array): Float32Array {
    return this.turned(positions, this.middle);
  }

  placedFrom(positions: Quantised): Float32Array {
    return this.placed(coordinates(positions));
  }

  /** Vectors of the capture as vectors of the scene. */
  vectorsFrom(vectors: Quantised): Float32Array {
    return this.turned(coordinates(vectors), [0, 0, 0]);
  }

  private turned(values: Float32Array, zero: readonly number[]): Float32Array {
    const { up, diagonal } = this.from.mesh;
    const found = new Float32Array(values.length);
    for (let at = 0; at < values.length; at += 3) {
      for (let k = 0; k < 3; k++) {
        const from = UPRIGHT[up][k];
        const axis = Math.abs(from) - 1;
        found[at + k] = (Math.sign(from) * (values[at + axis] - zero[axis])) / (diagonal || 1);
      }
    }
    return found;
  }
}

export function joined(all: readonly Float32Array[]): Float32Array {
  const found = new Float32Array(all.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const positions of all) {
    found.set(positions, at);
    at += positions.length;
  }
  return found;
}

export function lengths(vectors: Float32Array): Float32Array {
  return Float32Array.from({ length: vectors.length / 3 }, (_, i) =>
    Math.hypot(vectors[3 * i], vectors[3 * i + 1], vectors[3 * i + 2]),
  );
}

/** The value that all but a hundredth of the given ones stay below, so that one spike does not darken the rest; 1 where all are 0. */
export function scaleTop(values: readonly Float32Array[]): number {
  const all = joined(values).filter(Number.isFinite).sort();
  const top = all.at(Math.floor((all.length - 1) * 0.99)) ?? 0;
  return top > 0 ? top : 1;
}
