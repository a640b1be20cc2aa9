/** Where something is in the picture, in CSS pixels from its upper left corner. */
export interface Spot {
  readonly x: number;
  readonly y: number;
}

/** A picture: what takes points to clip space (4 × 4, column by column), and its size in CSS pixels. */
export interface Picture {
  readonly matrix: ArrayLike<number>;
  readonly width: number;
  readonly height: number;
}

/** The point that is seen at a spot: of those within `reach` pixels, the one nearest to the eye; null if no point is within reach. */
export function pointAt(positions: ArrayLike<number>, spot: Spot, picture: Picture, reach: number): number | null {
  const { matrix: m, width, height } = picture;
  let [nearest, depth] = [-1, Infinity];
  // Nothing is allocated for a point: there may be hundreds of thousands.
  for (let k = 0; k < positions.length; k += 3) {
    const x = positions[k];
    const y = positions[k + 1];
    const z = positions[k + 2];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (!(w > 0 && w < depth)) continue;
    const right = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w / 2 + 0.5) * width - spot.x;
    const down = (0.5 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w / 2) * height - spot.y;
    if (right * right + down * down > reach * reach) continue;
    nearest = k / 3;
    depth = w;
  }
  return nearest < 0 ? null : nearest;
}
