/** A corner of a regular polygon with so many, at distance 1 from the middle; the first is above, the others follow clockwise. y points down. */
export function cornerOf(corner: number, count: number): [number, number] {
  const angle = (2 * Math.PI * corner) / count;
  return [Math.sin(angle), -Math.cos(angle)];
}

/**
 * A weight for each corner of a regular polygon at a place, which sum to 1 and vary smoothly: Wachspress coordinates. Outside of the polygon some are
 * below 0; they are finite as far as {@link FARTHEST}.
 */
export function polygonWeights([x, y]: readonly [number, number], count: number): number[] {
  const to = Array.from({ length: count }, (_, k) => {
    const [cx, cy] = cornerOf(k, count);
    return [cx - x, cy - y] as const;
  });
  // Twice the area between the place and each edge; a weight is the product of all but those of the two edges at its corner.
  const areas = to.map(([ax, ay], k) => {
    const [bx, by] = to[(k + 1) % count];
    return ax * by - ay * bx;
  });
  const weights = areas.map((_, k) =>
    areas.reduce(
      (product, area, edge) => (edge === k || edge === (k + count - 1) % count ? product : product * area),
      1,
    ),
  );
  const sum = weights.reduce((a, b) => a + b, 0);
  return weights.map((weight) => weight / sum);
}

/** How far from the middle of its polygon a place may be. */
const FARTHEST = 1.05;

/** The nearest place that has weights. */
export function reachable([x, y]: readonly [number, number]): [number, number] {
  const scale = Math.min(1, FARTHEST / (Math.hypot(x, y) || 1));
  return [x * scale, y * scale];
}
