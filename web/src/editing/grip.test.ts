import { describe, expect, it } from 'vitest';
import { CageGraph, falloffWeights } from './falloff';
import { displace, gripOf, type Grip } from './grip';
import { rotationAbout, type Motion } from './motion';
import type { Vector } from '../coordinates/vector';
import { mirrorOf } from './symmetry';

/** A row of squares along x, bent to a U, whose ends are near each other in space and far on the surface. */
function strip(): CageGraph {
  const path: [number, number][] = [
    [-1, 3],
    [-1, 2],
    [-1, 1],
    [-1, 0],
    [1, 0],
    [1, 1],
    [1, 2],
    [1, 3],
  ];
  const positions = path.flatMap(([x, y]) => [x, y, 0, x, y, 1]);
  const triangles = path.slice(1).flatMap((_, k) => [2 * k, 2 * k + 2, 2 * k + 1, 2 * k + 1, 2 * k + 2, 2 * k + 3]);
  return new CageGraph({ positions: Float64Array.from(positions), triangles: Uint32Array.from(triangles) });
}

const graph = strip();
/** How far each vertex of the rest cage goes. */
const displacements = (grip: Grip, motion: Motion) => {
  const rows = Float64Array.from(graph.cage.positions);
  displace(rows, grip, motion, 1);
  return rows.map((x, k) => x - graph.cage.positions[k]);
};
const moved = (grip: Grip, by: Vector) => displacements(grip, { kind: 'move', by });
const alone = { radius: 0, measure: 'surface', mirror: null } as const;

describe('falloff', () => {
  it('moves the chosen vertex alone where the radius is 0', () => {
    const weights = falloffWeights(graph, [4], 0, 'surface');
    expect([...weights].map((weight, v) => (weight > 0 ? v : -1)).filter((v) => v >= 0)).toEqual([4]);
    expect(weights[4]).toBe(1);
  });

  it('falls with the distance and ends at the radius', () => {
    const weights = falloffWeights(graph, [0], 2.5, 'surface');
    expect(weights[2]).toBeCloseTo((1 - (1 / 2.5) ** 2) ** 2, 12);
    expect(weights[4]).toBeCloseTo((1 - (2 / 2.5) ** 2) ** 2, 12);
    expect(weights[6]).toBe(0);
  });

  it('goes along the surface or straight through space', () => {
    expect(falloffWeights(graph, [0], 2.5, 'surface')[14]).toBe(0);
    expect(falloffWeights(graph, [0], 2.5, 'space')[14]).toBeGreaterThan(0);
  });
});

describe('symmetry', () => {
  it('finds the partner of every vertex across the plane, and none where there is no symmetry', () => {
    const mirror = mirrorOf(graph, 'x');
    expect(mirror.share).toBe(1);
    expect([...mirror.partner.slice(0, 4)]).toEqual([14, 15, 12, 13]);
    const { positions, triangles } = graph.cage;
    const skewed = positions.map((x, k) =>
      k % 3 === 0 ? x * (1 + 0.4 * positions[k + 1]) + positions[k + 1] ** 2 : x,
    );
    expect(mirrorOf(new CageGraph({ positions: skewed, triangles }), 'x').share).toBeLessThan(0.5);
  });

  it('moves the partner the mirrored way, and keeps what is on the plane on it', () => {
    const mirror = mirrorOf(graph, 'x');
    const offsets = moved(gripOf(graph, [0], { ...alone, mirror }), [0.5, 0.25, -1]);
    expect([...offsets.slice(0, 3)]).toEqual([0.5, 0.25, -1]);
    expect([...offsets.slice(42, 45)]).toEqual([-0.5, 0.25, -1]);
    const across = mirrorOf(graph, 'z');
    const shared = moved(gripOf(graph, [2, 3], { ...alone, mirror: across }), [1, 0, 1]);
    expect([...shared.slice(6, 12)]).toEqual([1, 0, 0, 1, 0, 0]);
  });

  it('is mirrored in all vertices that follow', () => {
    const mirror = mirrorOf(graph, 'x');
    const offsets = moved(gripOf(graph, [0], { radius: 2.5, measure: 'surface', mirror }), [1, 2, 3]);
    for (let v = 0; v < graph.vertices; v++) {
      const other = mirror.partner[v];
      [-1, 1, 1].forEach((sign, k) => expect(offsets[3 * other + k]).toBeCloseTo(sign * offsets[3 * v + k], 12));
    }
  });

  it('mirrors rotations and scalings too', () => {
    const grip = gripOf(graph, [0, 1, 2, 3], { radius: 0, measure: 'surface', mirror: mirrorOf(graph, 'x') });
    const motions: Motion[] = [
      { kind: 'rotate', rotation: rotationAbout([1, 2, 3], 0.7) },
      { kind: 'scale', factors: [2, 0.5, 1.5] },
    ];
    for (const motion of motions) {
      const ways = displacements(grip, motion);
      expect(Math.hypot(...ways)).toBeGreaterThan(0.1);
      for (const v of [0, 1, 2, 3]) {
        const other = grip.mirror!.chosen[v];
        [-1, 1, 1].forEach((sign, k) => expect(ways[3 * other + k]).toBeCloseTo(sign * ways[3 * v + k], 12));
      }
    }
  });
});
