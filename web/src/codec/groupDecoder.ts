/** Everything that the coded sections of one capture need between one and the next: synchronous, for a worker. */

import type { FrameErrors, Residual } from '../capture';
import { CageBasis } from './basis';
import { cagesOf, decodeCageNumbers } from './cages';
import { decodeFaces } from './connectivity';
import { CodedDataError } from './error';
import { decodeFrameErrors } from './frameErrors';
import { type Hierarchy, vertexHierarchy } from './hierarchy';
import { type Polygons } from './polygons';
import { decodePositions } from './positions';
import { decodeResidual } from './residual';
import { decodeSurface, type PartSize } from './surface/decodeSurface';
import { type SplitMesh, splitMesh } from './surface/splitMesh';

export class GroupDecoder {
  private model: { polygons: Polygons; points: number } | null = null;
  private hierarchy: Hierarchy | null = null;
  private basis: CageBasis | null = null;

  faces(bytes: Uint8Array, points: number, faces: number, corners: number): Polygons {
    return decodeFaces(bytes, points, faces, corners);
  }

  positions(bytes: Uint8Array, faces: Polygons, points: number): Float64Array {
    return decodePositions(bytes, faces, points);
  }

  /** What lies on faces, as a mesh to draw; {@link decodeSurface}, {@link splitMesh}. */
  surface(
    bytes: Uint8Array,
    parts: readonly PartSize[],
    isTiled: readonly boolean[],
    faces: Polygons,
    points: number,
  ): SplitMesh {
    return splitMesh(decodeSurface(bytes, parts, isTiled.length, faces, points), points, isTiled);
  }

  errors(bytes: Uint8Array, frames: number): FrameErrors {
    return decodeFrameErrors(bytes, frames);
  }

  /** Says which mesh residuals are of. */
  setModel(polygons: Polygons, points: number): void {
    this.model = { polygons, points };
    this.hierarchy = null;
  }

  /** Adds coordinates of sampled points to the basis of cages, points × columns; `isFirst` begins a new basis. */
  addCoordinates(coordinates: Float64Array, columns: number, rows: number, isFirst: boolean): void {
    if (isFirst || this.basis === null) this.basis = new CageBasis(rows);
    this.basis.add(coordinates, columns);
  }

  /** The cages of a group of so many frames, frames × rows × 3. */
  cages(bytes: Uint8Array, frames: number, rest: Float64Array): Float32Array {
    const numbers = decodeCageNumbers(bytes, frames, rest.length / 3);
    if (this.basis === null) throw new CodedDataError('there are no coordinates for the basis of the cages');
    return cagesOf(numbers, this.basis, rest);
  }

  /** {@link decodeResidual} of the model of {@link setModel}. */
  residual(bytes: Uint8Array, frames: number, mostNumbers: number): Residual {
    if (this.model === null) throw new CodedDataError('there is no model for the residual');
    this.hierarchy ??= vertexHierarchy(this.model.polygons, this.model.points);
    return decodeResidual(bytes, this.hierarchy, frames, mostNumbers);
  }
}
