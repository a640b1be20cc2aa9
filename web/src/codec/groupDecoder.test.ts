import { readFileSync } from 'node:fs';
import { expect, it } from 'vitest';
import { allBlocks, openBytes, positionsOf } from '../../tests/support/containers';
import { diagonalOf } from '../coordinates/topology';
import { decodeFaces } from './connectivity';
import { CodedDataError } from './error';
import { vertexHierarchy } from './hierarchy';
import { parallelogramPredictions } from './parallelograms';
import type { Polygons } from './polygons';
import { decodePositions } from './positions';
import { decodeResidual } from './residual';

const read = (name: string) => new Uint8Array(readFileSync(new URL(`testdata/${name}`, import.meta.url)));
const captured = new Float32Array(read('connected-captured.npy').slice(128).buffer);

it.each(['connected', 'connected-parted'])(
  'every point of every frame of %s is within the promised bound',
  async (name) => {
    const capture = await openBytes(read(`${name}.cager`));
    const blocks = await allBlocks(capture);
    const { rank, correctedPoints } = blocks[0].residual!;
    expect(rank).toBeGreaterThan(1);
    expect(correctedPoints.length).toBeGreaterThan(1);
    const positions = positionsOf(capture.static, blocks);
    expect(positions.length).toBe(captured.length);
    const perFrame = positions.length / capture.frames / 3;
    const farthest = new Float64Array(capture.frames);
    for (let point = 0; point < positions.length / 3; point++) {
      const difference = [0, 1, 2].map((axis) => positions[3 * point + axis] - captured[3 * point + axis]);
      const frame = Math.floor(point / perFrame);
      farthest[frame] = Math.max(farthest[frame], Math.hypot(...difference) / diagonalOf(capture.static.rest));
    }
    farthest.forEach((far, frame) => {
      expect(far).toBeLessThanOrEqual(1e-3);
      // What the encoder measured on its own decoder's positions, to twelve binary digits.
      expect(Math.abs(far - capture.errors.linf[frame])).toBeLessThan(1e-6);
    });
  },
);

it('faces, coded in another order, are those of the capture', async () => {
  const { cornerCounts, corners, rest } = (await openBytes(read('connected.cager'))).static;
  const points = rest.length / 3;
  const byCount = [3, 4, 5].map((count) => cornerCounts.filter((other) => other === count).length);
  expect(byCount).toEqual([125, 179, 1]);
  expect(new Set(corners).size).toBe(points - 1);
});

function strip(side: number): { faces: Polygons; points: number } {
  const corners: number[] = [];
  for (let k = 0; k + side + 1 < side * side; k++) {
    if (k % side < side - 1) corners.push(k, k + 1, k + side + 1, k + side);
  }
  return {
    faces: { counts: new Uint32Array(corners.length / 4).fill(4), corners: Uint32Array.from(corners) },
    points: side * side + 3,
  };
}

it('every vertex comes once and after those that predict it', () => {
  const { faces, points } = strip(12);
  const hierarchy = vertexHierarchy(faces, points);
  const known = new Set<number>();
  hierarchy.order.forEach((vertex, k) => {
    const parents = hierarchy.parents.subarray(hierarchy.starts[k], hierarchy.starts[k + 1]);
    expect(parents.every((parent) => known.has(parent)) && !known.has(vertex)).toBe(true);
    known.add(vertex);
  });
  expect(known.size).toBe(points);
  const predicted = hierarchy.order.filter((_, k) => hierarchy.starts[k + 1] > hierarchy.starts[k]);
  expect(predicted.length).toBeGreaterThanOrEqual(points - 48 - 3);

  const predictions = parallelogramPredictions(faces, points);
  const placed = new Set<number>();
  predictions.order.forEach((vertex, k) => {
    const triples = predictions.triples.slice(3 * predictions.starts[k], 3 * predictions.starts[k + 1]);
    expect(triples.every((v) => placed.has(v)) && (k === 0 || placed.has(predictions.near[k]))).toBe(true);
    placed.add(vertex);
  });
  expect(placed.size).toBe(points);
});

it('bytes that no encoder wrote are an error or numbers of the mesh', () => {
  const { faces, points } = strip(9);
  const hierarchy = vertexHierarchy(faces, points);
  let state = 11;
  const attempt = <T>(decode: () => T, check: (found: T) => void) => {
    try {
      check(decode());
    } catch (error) {
      expect(error).toBeInstanceOf(CodedDataError);
    }
  };
  for (let turn = 0; turn < 120; turn++) {
    const bytes = Uint8Array.from(
      { length: 22 + 4 * (turn % 40) },
      () => (state = (state * 48_271) % 2_147_483_647) >> 8,
    );
    attempt(
      () => decodeFaces(bytes.subarray(2), points, 20, 60),
      ({ corners }) => expect(corners.every((v) => v < points)).toBe(true),
    );
    attempt(
      () => decodePositions(bytes.subarray(2), faces, points),
      (positions) => expect(positions.length).toBe(3 * points),
    );
    bytes.fill(0, 0, 22);
    bytes[8] = turn % 5;
    bytes[18] = bytes.length - 22;
    attempt(
      () => decodeResidual(bytes, hierarchy, 6, 1e6),
      ({ shapes }) => expect(shapes.length).toBe(3 * points * (turn % 5)),
    );
  }
});
