import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { openBytes, randomNumbers } from '../../../tests/support/containers';
import { withNames } from '../../../tests/support/surfaces';
import { CodedDataError } from '../error';
import { polygonsOf } from '../polygons';
import type { SplitNormals } from './splitVertices';
import { decodeTilts } from './tilts';

type Vector = readonly number[];

const fileOf = (name: string) => readFileSync(new URL(`../testdata/${name}`, import.meta.url));
const bytes = new Uint8Array(fileOf('tilted.cager'));

const dot = (a: Vector, b: Vector) => a.reduce((sum, x, k) => sum + x * b[k], 0);
const minus = (a: Vector, b: Vector) => a.map((x, k) => x - b[k]);
const cross = ([a, b, c]: Vector, [x, y, z]: Vector): Vector => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (a: Vector) => a.map((x) => x / Math.sqrt(dot(a, a)));
const degrees = (a: Vector, b: Vector) => (Math.acos(Math.min(1, dot(unit(a), unit(b)))) * 180) / Math.PI;

/** The lines of `.obj` text that begin with a word, as numbers. */
function linesOf(text: string, word: string): number[][] {
  const lines = text.split('\n').filter((line) => line.startsWith(`${word} `));
  return lines.map((line) => line.split(/[ /]+/).slice(1).map(Number));
}

/** A normal as the shader computes it, and how far it leans from the faces around. */
function normalOf(split: SplitNormals, k: number, places: readonly Vector[]): { mean: Vector; normal: Vector } {
  const own = places[split.points[k]];
  let sum: Vector = [0, 0, 0];
  for (let fan = split.fanStarts[k]; fan < split.fanStarts[k + 1]; fan++) {
    const [a, b] = [split.fans[2 * fan], split.fans[2 * fan + 1]].map((point) => minus(places[point], own));
    sum = sum.map((x, axis) => x + cross(a, b)[axis]);
  }
  const mean = unit(sum);
  const edge = minus(places[split.next[k]], own);
  const along = unit(
    minus(
      edge,
      mean.map((x) => x * dot(edge, mean)),
    ),
  );
  const across = cross(mean, along);
  const [x, y] = split.tilts!.subarray(2 * k, 2 * k + 2);
  const angle = Math.hypot(x, y);
  const part = angle > 0 ? Math.sin(angle) / angle : 0;
  return { mean, normal: mean.map((n, axis) => Math.cos(angle) * n + part * (x * along[axis] + y * across[axis])) };
}

describe('tilted normals', () => {
  it('are those that the program decodes', async () => {
    const { mesh } = (await (await openBytes(bytes)).surface!())!;
    const text = fileOf('tilted.obj').toString();
    const [places, normals] = [linesOf(text, 'v'), linesOf(text, 'vn')];
    const split = mesh.split!;
    const wanted = new Map<number, Vector>();
    for (const face of linesOf(text, 'f')) {
      for (let k = 0; k < face.length; k += 2) wanted.set(face[k] - 1, normals[face[k + 1] - 1]);
    }
    expect(split.points.length).toBe(36);
    const found = [...split.points.keys()].map((k) => normalOf(split, k, places));
    const [tilts, errors] = [found.map(({ mean }) => mean), found.map(({ normal }) => normal)].map((list) =>
      list.map((normal, k) => degrees(normal, wanted.get(split.points[k])!)),
    );
    // Faces are weighted by their areas here, by their angles there.
    expect(Math.max(...errors)).toBeLessThan(1);
    expect(tilts.filter((angle) => angle > 15).length).toBe(24);
    expect(tilts.filter((angle) => angle < 1).length).toBe(12);
  });

  it('that the names do not tell of are refused', async () => {
    const plain = await openBytes(withNames(bytes, (json) => json.replace('"tilts":{},', '')));
    expect(await plain.surface!()).toBeNull();
    expect(plain.problem).toMatch(/damaged/);
  });

  it('of damaged bytes are an error, or at most half a turn', () => {
    const faces = polygonsOf(Uint32Array.from({ length: 900 }, (_, k) => Math.floor(k / 3) + (k % 3)));
    const sharing = { numbers: faces.corners, count: 302 };
    const random = randomNumbers(3);
    let errors = 0;
    for (let turn = 0; turn < 200; turn++) {
      try {
        const angles = decodeTilts(
          Uint8Array.from({ length: 4 * random(9) }, () => random(256)),
          faces,
          sharing,
        );
        expect(angles.every((angle) => Math.abs(angle) < 3.1416)).toBe(true);
      } catch (error) {
        expect(error).toBeInstanceOf(CodedDataError);
        errors++;
      }
    }
    expect(errors).toBeGreaterThan(20);
  });
});
