import { describe, expect, it } from 'vitest';
import { diagonalOf } from '../coordinates/topology';
import golden from './harmonicPhi.json';
import {
  allBlocks,
  GOLDEN,
  goldenBytes,
  goldenPositions,
  openBytes,
  positionsOf,
} from '../../tests/support/containers';

/** How far a decoded point may be from what the program decoded, over the diagonal; as in tests/cli/golden.rs. */
const TOLERANCE = 1e-7;

describe.each(GOLDEN)('the golden file %s', (name) => {
  const open = () => openBytes(goldenBytes(name));

  it('has the model, the cage and the figures that it was written with', async () => {
    const capture = await open();
    const { head, static: part } = capture;
    expect(capture.problem).toBeNull();
    expect(part.system).toBe(
      name.replace(/^(coded(-parted)?|definition3|edited|rounded)-|-(elements|origin|edited)$/g, ''),
    );
    expect([head.points, part.rest.length / 3, part.cage.positions.length / 3]).toEqual([120, 120, 26]);
    expect(part.cage.triangles.length / 3).toBe(48);
    expect(part.cornerCounts.reduce((sum, count) => sum + count, 0)).toBe(part.corners.length);
    expect([part.cornerCounts.length, part.corners.length]).toEqual([head.restFaces, head.restCorners]);
    expect(part.rowsPerFrame).toBe(name.includes('free') ? 26 + 48 : 26);
    expect(part.origin !== undefined).toBe(name.endsWith('-origin'));
    expect(capture.frames).toBe(3);
    expect(capture.complete).toBe(true);
    expect(part.report?.generator).toMatch(/^cager /);
    expect(part.elements !== undefined).toBe(name.includes('elements') || /^(coded|rounded)-harmonic$/.test(name));
    expect([capture.errors.l2.length, capture.errors.linf.length]).toEqual([3, 3]);
    const { max_error: bound } = (part.report?.coding ?? {}) as { max_error?: number };
    capture.errors.linf.forEach((linf, k) => {
      // Of edited frames nobody knows the errors.
      const isEdited = capture.layers!.some(({ isOn, first, count }) => isOn && k >= first && k < first + count);
      expect(Number.isNaN(linf)).toBe(isEdited);
      if (isEdited) return;
      expect(linf).toBeGreaterThanOrEqual(capture.errors.l2[k]);
      expect(linf).toBeLessThanOrEqual(bound ?? 0.1);
    });
  });

  it('decodes to the positions that it always did', async () => {
    const phi = harmonicPhi(name);
    const coordinates = phi && (() => Promise.resolve(Float64Array.from(phi)));
    const capture = await openBytes(goldenBytes(name), coordinates && { coordinates });
    const expected = goldenPositions(name);
    const found = positionsOf(capture.static, await allBlocks(capture), phi);
    expect(found.length).toBe(expected.length);
    const { origin = [0, 0, 0] } = capture.static;
    const farthest = found.reduce((far, x, k) => Math.max(far, Math.abs(x - (expected[k] - origin[k % 3]))), 0);
    expect(farthest / diagonalOf(capture.static.rest)).toBeLessThanOrEqual(TOLERANCE);
  });
});

/** Φ of the golden files with harmonic coordinates, as `GET …/coordinates` of the service answered for their model and cage. */
function harmonicPhi(name: string): Float32Array | undefined {
  if (!name.includes('harmonic')) return undefined;
  const solved = name === 'coded-harmonic' || name === 'rounded-harmonic' ? name : 'definition3-harmonic';
  const text = golden[solved];
  return new Float32Array(Uint8Array.from(Buffer.from(text, 'base64')).buffer);
}

it('has a file of every coordinate system, and coded ones', () => {
  const names = ['mvc', 'harmonic', 'green', 'green-free'].map((system) => `definition3-${system}`);
  const coded = [
    'coded-mvc',
    'coded-green',
    'coded-green-free',
    'coded-harmonic',
    'coded-parted-mvc',
    'rounded-mvc',
    'rounded-harmonic',
  ];
  expect(GOLDEN).toEqual(expect.arrayContaining([...names, ...coded]));
});

it('shows no cages of harmonic files of earlier programs without the coordinates that they are in', async () => {
  const capture = await openBytes(goldenBytes('coded-harmonic'));
  await expect(allBlocks(capture)).rejects.toThrow(/Harmonic coordinates cannot be computed/);
  expect(await allBlocks(await openBytes(goldenBytes('rounded-harmonic')))).not.toEqual([]);
});
