import { Matrix4, Vector3, Vector4 } from 'three';
import { cross, norm, normalized, sub, type Vector } from '../coordinates/vector';

/** A place in the picture, in CSS pixels from its upper left corner, and how deep behind it a point is. */
export interface Place {
  readonly x: number;
  readonly y: number;
  /** −1 at the near plane to 1 at the far one. */
  readonly depth: number;
}

export interface Ray {
  readonly origin: Vector;
  /** Of unit length. */
  readonly direction: Vector;
}

/** Where points of the scene are in the picture, and the other way round. */
export class Projection {
  private readonly inverse: Matrix4;

  /**
   * @param matrix from the scene to clip space
   * @param width size of the picture in CSS pixels
   */
  constructor(
    private readonly matrix: Matrix4,
    readonly width: number,
    readonly height: number,
  ) {
    this.inverse = matrix.clone().invert();
  }

  /** Where a point is; null of one behind the eye. */
  place([x, y, z]: Vector): Place | null {
    const at = new Vector4(x, y, z, 1).applyMatrix4(this.matrix);
    if (at.w <= 0) return null;
    at.divideScalar(at.w);
    return { x: (at.x / 2 + 0.5) * this.width, y: (0.5 - at.y / 2) * this.height, depth: at.z };
  }

  point({ x, y, depth }: Place): Vector {
    return new Vector3((2 * x) / this.width - 1, 1 - (2 * y) / this.height, depth).applyMatrix4(this.inverse).toArray();
  }

  ray(x: number, y: number): Ray {
    const origin = this.point({ x, y, depth: -1 });
    return { origin, direction: normalized(sub(this.point({ x, y, depth: 0.5 }), origin)) };
  }

  /** The directions to the right, upwards and away, at a point; of unit length. */
  axes(at: Vector): { readonly right: Vector; readonly up: Vector; readonly away: Vector } {
    const { x, y, depth } = this.place(at) ?? { x: this.width / 2, y: this.height / 2, depth: 0 };
    const away = this.ray(x, y).direction;
    const right = normalized(sub(this.point({ x: x + 1, y, depth }), this.point({ x: x - 1, y, depth })));
    return { right, up: normalized(cross(right, away)), away };
  }

  /** Length in the scene of one pixel of the picture at a point. */
  unitsPerPixel(at: Vector): number {
    const place = this.place(at);
    if (!place) return 0;
    const { x, y, depth } = place;
    return norm(sub(this.point({ x: x + 1, y, depth }), this.point({ x: x - 1, y, depth }))) / 2;
  }
}
