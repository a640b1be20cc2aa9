/** A point or a direction: x y z. */
export type Vector = readonly [number, number, number];

/** A place in the picture, in CSS pixels from its upper left corner, and how deep behind it a point is. */
export interface Place {
  readonly x: number;
  readonly y: number;
  /** −1 at the near plane to 1 at the far one. */
  readonly depth: number;
}

/** A half-line: what lies behind a place in the picture. */
export interface Ray {
  readonly origin: Vector;
  /** Of unit length. */
  readonly direction: Vector;
}

/** Where points of the scene are in the picture, and the other way round. */
export class Projection {
  private readonly inverse: Float64Array;

  /**
   * @param matrix 4 × 4, column by column: from the scene to clip space
   * @param width size of the picture in CSS pixels
   */
  constructor(
    private readonly matrix: ArrayLike<number>,
    readonly width: number,
    readonly height: number,
  ) {
    this.inverse = inverseOf(matrix);
  }

  /** Where a point is; null of one behind the eye. */
  place([x, y, z]: Vector): Place | null {
    const [cx, cy, cz, cw] = transformed(this.matrix, x, y, z, 1);
    if (cw <= 0) return null;
    return { x: (cx / cw / 2 + 0.5) * this.width, y: (0.5 - cy / cw / 2) * this.height, depth: cz / cw };
  }

  /** The point at a place. */
  point({ x, y, depth }: Place): Vector {
    const [px, py, pz, pw] = transformed(this.inverse, (2 * x) / this.width - 1, 1 - (2 * y) / this.height, depth, 1);
    return [px / pw, py / pw, pz / pw];
  }

  /** What lies behind a place. */
  ray(x: number, y: number): Ray {
    const origin = this.point({ x, y, depth: -1 });
    return { origin, direction: normalized(minus(this.point({ x, y, depth: 0.5 }), origin)) };
  }

  /** The directions to the right, upwards and away, at a point; of unit length. */
  axes(at: Vector): { readonly right: Vector; readonly up: Vector; readonly away: Vector } {
    const { x, y, depth } = this.place(at) ?? { x: this.width / 2, y: this.height / 2, depth: 0 };
    const away = this.ray(x, y).direction;
    const right = normalized(minus(this.point({ x: x + 1, y, depth }), this.point({ x: x - 1, y, depth })));
    return { right, up: normalized(cross(right, away)), away };
  }

  /** Length in the scene of one pixel of the picture at a point. */
  unitsPerPixel(at: Vector): number {
    const place = this.place(at);
    if (!place) return 0;
    const { x, y, depth } = place;
    return length(minus(this.point({ x: x + 1, y, depth }), this.point({ x: x - 1, y, depth }))) / 2;
  }
}

export function minus(a: Vector, b: Vector): Vector {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

/** a + share · b. */
export function plus(a: Vector, b: Vector, share = 1): Vector {
  return [a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]];
}

export function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function length(a: Vector): number {
  return Math.hypot(...a);
}

export function normalized(a: Vector): Vector {
  const long = length(a) || 1;
  return [a[0] / long, a[1] / long, a[2] / long];
}

function transformed(m: ArrayLike<number>, x: number, y: number, z: number, w: number) {
  const row = (k: number) => m[k] * x + m[4 + k] * y + m[8 + k] * z + m[12 + k] * w;
  return [row(0), row(1), row(2), row(3)] as const;
}

/** Gauss–Jordan elimination with row exchange; a singular matrix gives one that is not finite. */
function inverseOf(matrix: ArrayLike<number>): Float64Array {
  const rows = Array.from({ length: 4 }, (_, r) =>
    Array.from({ length: 8 }, (_, c) => (c < 4 ? matrix[4 * c + r] : Number(c - 4 === r))),
  );
  for (let k = 0; k < 4; k++) {
    let pivot = k;
    for (let r = k + 1; r < 4; r++) if (Math.abs(rows[r][k]) > Math.abs(rows[pivot][k])) pivot = r;
    [rows[k], rows[pivot]] = [rows[pivot], rows[k]];
    const scale = 1 / rows[k][k];
    rows[k] = rows[k].map((x) => x * scale);
    for (let r = 0; r < 4; r++) {
      const factor = rows[r][k];
      if (r !== k) rows[r] = rows[r].map((x, c) => x - factor * rows[k][c]);
    }
  }
  return Float64Array.from({ length: 16 }, (_, k) => rows[k % 4][4 + (k >> 2)]);
}
