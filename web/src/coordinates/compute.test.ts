import { describe, expect, it } from 'vitest';
import type { CoordinateSystem, TriangleMesh } from '../capture';
import { columnsOf, computeCoordinates, rowsOf } from './compute';
import golden from './golden.json';
import { TiedNormals } from './tiedNormals';
import { diagonalOf } from './topology';

/** Points inside, outside, on vertices, edges and faces, and hardly beside them; Φ is what `GET …/coordinates` of the service answered. */
const cage: TriangleMesh = {
  positions: Float64Array.from(golden.vertices.flat()),
  triangles: Uint32Array.from(golden.triangles.flat()),
};
const points = Float64Array.from(golden.points.flat());

function expectedPhi(text: string): Float32Array {
  return new Float32Array(Uint8Array.from(Buffer.from(text, 'base64')).buffer);
}

/** What Φ multiplies to give back the rest pose. */
function restValues(system: CoordinateSystem): Float64Array {
  const values = new Float64Array(3 * columnsOf(system, cage));
  values.set(cage.positions);
  if (system !== 'mvc') new TiedNormals(cage).write(cage.positions, values, cage.positions.length);
  return values;
}

describe.each(['mvc', 'green'] as const)('%s coordinates', (system) => {
  const phi = computeCoordinates(system, cage, points);
  const columns = columnsOf(system, cage);

  it('are those of the encoder, entry by entry', () => {
    const expected = expectedPhi(golden[system]);
    expect(phi.length).toBe(expected.length);
    let worst = 0;
    for (let k = 0; k < phi.length; k++) {
      // The service sends single precision; far outside, entries of Green coordinates are large.
      worst = Math.max(worst, Math.abs(phi[k] - expected[k]) / Math.max(1, Math.abs(expected[k])));
    }
    expect(worst).toBeLessThan(1e-7);
  });

  it('give back every rest point, wherever it lies', () => {
    const values = restValues(system);
    const diagonal = diagonalOf(cage.positions);
    for (let i = 0; i < points.length / 3; i++) {
      for (let axis = 0; axis < 3; axis++) {
        let sum = 0;
        for (let j = 0; j < columns; j++) sum += phi[i * columns + j] * values[3 * j + axis];
        expect(Math.abs(sum - points[3 * i + axis]) / diagonal, `point ${i}`).toBeLessThan(1e-9);
      }
    }
  });
});

describe('coordinates of a cage of two components', () => {
  const half = cage.positions.length / 3;
  const both = {
    positions: Float64Array.from([...cage.positions, ...cage.positions]),
    triangles: Uint32Array.from([...cage.triangles, ...cage.triangles.map((vertex) => vertex + half)]),
  };
  const carrier = (points: number, firstVertex: number) => ({ points, firstVertex, vertices: half });
  const rows = points.length / 3;
  const carriers = [carrier(3, half), carrier(2, 0), carrier(rows - 5, half)];

  it('are those in the component that carries the point, and zero elsewhere', () => {
    const single = computeCoordinates('mvc', cage, points);
    const phi = computeCoordinates('mvc', { ...both, carriers }, points);
    for (let i = 0; i < rows; i++) {
      const first = i === 3 || i === 4 ? 0 : half;
      const row = phi.subarray(2 * half * i, 2 * half * (i + 1));
      expect(row.subarray(first, first + half)).toEqual(single.subarray(half * i, half * (i + 1)));
      expect(row.subarray(half - first, 2 * half - first).every((value) => value === 0)).toBe(true);
    }
  });

  it('are the same for points from any place on, in any order', () => {
    const phi = computeCoordinates('mvc', { ...both, carriers }, points);
    const from = computeCoordinates('mvc', { ...both, carriers }, points.subarray(12), 4);
    expect(from).toEqual(phi.subarray(8 * half));
    const fill = rowsOf('mvc', { ...both, carriers });
    const row = new Float64Array(2 * half);
    for (const i of [4, 0, rows - 1]) {
      fill(i, points[3 * i], points[3 * i + 1], points[3 * i + 2], row, 0);
      expect(row).toEqual(phi.subarray(2 * half * i, 2 * half * (i + 1)));
    }
  });
});

describe('computeCoordinates', () => {
  it('says that harmonic coordinates come from the service', () => {
    expect(() => computeCoordinates('harmonic', cage, points)).toThrow(/service/);
  });

  it('refuses a cage with a hole', () => {
    const open = { positions: cage.positions, triangles: cage.triangles.slice(3) };
    expect(() => computeCoordinates('mvc', open, points)).toThrow(/not closed/);
  });
});

describe('TiedNormals', () => {
  it('stretch with the cage and turn with it', () => {
    const normals = new TiedNormals(cage);
    const rest = new Float64Array(cage.triangles.length);
    normals.write(cage.positions, rest, 0);
    const turned = Float64Array.from(cage.positions);
    for (let k = 0; k < turned.length; k += 3) {
      [turned[k], turned[k + 1], turned[k + 2]] = [
        -2 * cage.positions[k + 1],
        2 * cage.positions[k],
        2 * cage.positions[k + 2],
      ];
    }
    const after = new Float64Array(cage.triangles.length);
    normals.write(turned, after, 0);
    for (let k = 0; k < after.length; k += 3) {
      expect(after[k]).toBeCloseTo(-2 * rest[k + 1], 12);
      expect(after[k + 1]).toBeCloseTo(2 * rest[k], 12);
      expect(after[k + 2]).toBeCloseTo(2 * rest[k + 2], 12);
    }
  });

  it('are zero for a face that has collapsed', () => {
    const normals = new TiedNormals(cage);
    const out = new Float64Array(cage.triangles.length);
    normals.write(new Float64Array(cage.positions.length), out, 0);
    expect(out.every((value) => value === 0)).toBe(true);
  });
});
