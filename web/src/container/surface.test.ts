import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import type { ModelSurface } from '../capture';
import { CodedDataError } from '../codec/error';
import { decodeSurface } from '../codec/surface/decodeSurface';
import { splitMesh } from '../codec/surface/splitMesh';
import { LocalCodec } from '../../tests/support/localCodec';
import { allBlocks, offsetOf, openBytes, randomNumbers, rawPart, withPart } from '../../tests/support/containers';
import { namesOf, surfaceBytes, withNames, withPictures } from '../../tests/support/surfaces';
import { HEADER_BYTES } from './section';
import { ContainerStream } from './stream';
import { parseSurface } from './surface';

const bytes = surfaceBytes();
const surfaceOf = async (file: Uint8Array): Promise<ModelSurface> => (await (await openBytes(file)).surface!())!;

/** The corners of all triangles of `.obj` text by object and material, in order: point, texture coordinate, and which normal of the point. */
function trianglesOf(text: string): Map<string, string[]> {
  const uvs: string[] = [];
  const found = new Map<string, string[]>();
  let [part, material] = [-1, ''];
  for (const line of text.split('\n')) {
    const [kind, ...words] = line.split(' ');
    if (kind === 'vt') uvs.push(words.map(Number).map(rounded).join());
    if (kind === 'o') part++;
    if (kind === 'usemtl') material = words[0];
    if (kind !== 'f') continue;
    const corners = words.map((word) => word.split('/').map(Number)).map(([v, t]) => `${v - 1} ${uvs[t - 1]}`);
    const key = `${part} ${material}`;
    const list = found.get(key) ?? [];
    found.set(key, list);
    for (let k = 2; k < corners.length; k++) list.push(corners[0], corners[k - 1], corners[k]);
  }
  return found;
}

const rounded = (x: number) => (Math.round(1e4 * x) / 1e4 || 0).toString();

/** Pairs of corners of one point, and whether they share a normal. */
function sharedNormals(corners: readonly (readonly [point: number, normal: number])[]): boolean[] {
  return corners.flatMap(([point, normal], k) =>
    corners.slice(0, k).flatMap(([other, before]) => (other === point ? [before === normal] : [])),
  );
}

describe('what lies on faces', () => {
  const text = readFileSync(new URL('../codec/testdata/surface.obj', import.meta.url), 'utf8');

  it('is what the program decodes, face by face', async () => {
    const { parts, materials, mesh } = await surfaceOf(bytes);
    expect(parts.map(({ path, firstPoint, points, shown }) => [path, firstPoint, points, shown])).toEqual([
      ['/box', 0, 98, null],
      ['/lid', 98, 25, null],
    ]);
    expect(materials.map(({ name }) => name)).toEqual(['painted', 'glass']);
    expect(materials[0].textures).toEqual([{ channel: 'base_color', path: 'painted.png' }]);
    expect(materials[1]).toMatchObject({
      opacity: expect.closeTo(0.4) as number,
      metalness: expect.closeTo(0.25) as number,
    });
    const found = new Map(
      mesh.ranges.map(({ part, material, start, count }) => [
        `${part} ${materials[material - 1].name}`,
        [...mesh.triangles.subarray(start, start + count)].map(
          (vertex) =>
            `${mesh.points[vertex]} ${[...mesh.uvs.subarray(2 * vertex, 2 * vertex + 2)].map(rounded).join()}`,
        ),
      ]),
    );
    const expected = trianglesOf(text);
    expect(expected.size).toBe(3);
    expect(found).toEqual(expected);
  });

  it('has the hard edges that the program decodes', async () => {
    const { mesh } = await surfaceOf(bytes);
    const faces = text.split('\n').filter((line) => line.startsWith('f '));
    const box = faces.slice(0, 96).flatMap((line) => line.slice(2).split(' '));
    const corners = box.map((word) => word.split('/').map(Number)).map(([v, , n]) => [v - 1, n] as const);
    // Quads as two triangles: a face's corners are 0, 1, 2 and the last of the second triangle.
    const quads = mesh.ranges
      .filter(({ part }) => part === 0)
      .flatMap(({ start, count }) => Array.from({ length: count / 6 }, (_, k) => start + 6 * k));
    const ours = quads
      .flatMap((at) => [at, at + 1, at + 2, at + 5])
      .map((at) => mesh.triangles[at])
      .map((vertex) => [mesh.points[vertex], mesh.normals[vertex]] as const);
    expect(sharedNormals(ours)).toEqual(sharedNormals(corners));
    // Each of the box's 8 corners has three normals, and each of the 36 other points of its edges two.
    expect(mesh.split!.points.length).toBe(123 + 2 * 8 + 36);
  });

  it('is the same in a container that arrives in pieces, with its pictures', async () => {
    const stream = new ContainerStream();
    const file = withPictures(bytes, { 'a.png': Uint8Array.of(1, 2, 3) });
    for (let at = 0; !stream.begin(file.subarray(at, at + 100)); at += 100);
    const codec = new LocalCodec();
    const part = await stream.decodeStatic(codec);
    expect(await stream.surface(part, codec)).toEqual(await surfaceOf(bytes));
    expect((await stream.pictures()).size).toBe(1);
    const damaged = file.slice();
    damaged[offsetOf(file, 'surf') + HEADER_BYTES + 20] ^= 1;
    const other = new ContainerStream();
    expect(other.begin(damaged)).toBe(true);
    expect(await other.surface(await other.decodeStatic(codec), codec)).toBeNull();
  });

  it('is split by tiles of pictures', () => {
    const uvs = {
      values: Float32Array.of(0.5, 0.5, 2.5, 0.5, 0.5, 3.5, -1, 0),
      numbers: Uint32Array.of(0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3),
    };
    const faces = { counts: new Uint32Array(4).fill(3), corners: Uint32Array.of(0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2) };
    const part = { faces, uvs, normals: null, tilts: null, materials: new Uint32Array(4).fill(1) };
    const tiles = (isTiled: boolean) => splitMesh([part], 3, [isTiled]).ranges.map(({ tile, count }) => [tile, count]);
    expect(tiles(false)).toEqual([[1001, 12]]);
    expect(tiles(true)).toEqual([
      [1001, 6],
      [1003, 3],
      [1031, 3],
    ]);
  });
});

describe('damage', () => {
  it.each([
    ['is no JSON', () => '{', /what lies on the faces cannot be read/],
    ['has no list of parts', () => '{"parts": 3}', /what lies on the faces cannot be read/],
    ['has parts of another mesh', () => '{"parts": [{"points": 5}]}', /parts are not those of the mesh/],
    [
      'has one part alone',
      (json: string) => json.replace(/"points":98/, '"points":97').replace(/"points":25/, '"points":26'),
      /two parts/,
    ],
    ['names fewer sets', (json: string) => json.replace(/"uv_sets":\[[^\]]*\]/, '"uv_sets":[]'), /damaged/],
  ] as const)('of names that %s is said, and the frames are shown', async (_, change, problem) => {
    const capture = await openBytes(withNames(bytes, change));
    expect(capture.problem).toBeNull();
    expect(await capture.surface!()).toBeNull();
    expect(capture.problem).toMatch(problem);
    expect((await allBlocks(capture)).length).toBe(1);
  });

  it('of numbers is an error, or a mesh that can be drawn', async () => {
    const { static: part, head } = await openBytes(bytes);
    const { sizes, numbers, materials } = parseSurface(namesOf(bytes).section, head);
    const faces = { counts: part.cornerCounts, corners: part.corners };
    const random = randomNumbers(7);
    let errors = 0;
    for (let turn = 0; turn < 200; turn++) {
      const damaged = numbers.slice(0, turn % 3 === 0 ? random(numbers.length) : numbers.length);
      for (let k = 0; k < 1 + random(4) && damaged.length > 0; k++) damaged[random(damaged.length)] = random(256);
      try {
        const found = decodeSurface(damaged, sizes, materials.length, faces, head.points);
        const mesh = splitMesh(
          found,
          head.points,
          materials.map(() => true),
        );
        expect(mesh.triangles.every((vertex) => vertex < mesh.points.length)).toBe(true);
        expect(mesh.points.every((point) => point < head.points)).toBe(true);
        expect(mesh.ranges.every(({ material }) => material <= materials.length)).toBe(true);
      } catch (error) {
        expect(error).toBeInstanceOf(CodedDataError);
        errors++;
      }
    }
    expect(errors).toBeGreaterThan(20);
  });
});

describe('pictures', () => {
  const files = { 'a.png': Uint8Array.of(1, 2, 3), 'b.png': Uint8Array.of(4) };

  it('are those of the file', async () => {
    const capture = await openBytes(withPictures(bytes, files));
    expect([...(await capture.pictures!())].map(([path, found]) => [path, [...found]])).toEqual([
      ['a.png', [1, 2, 3]],
      ['b.png', [4]],
    ]);
    expect((await (await openBytes(bytes)).pictures!()).size).toBe(0);
  });

  it.each([
    ['beyond the end', '[{"path":"a.png","first":0,"bytes":3}]', /names bytes that are not there/],
    ['at no place', '[{"path":"a.png","first":-1,"bytes":1}]', /cannot be read/],
    ['in no list', '{}', /cannot be read/],
  ])('%s are left out', async (_, json, problem) => {
    const list = new TextEncoder().encode(json);
    const payload = Uint8Array.of(list.length, 0, 0, 0, ...list, 1, 2);
    const capture = await openBytes(withPart(bytes, rawPart('pict', payload), 'surf'));
    expect((await capture.pictures!()).size).toBe(0);
    expect(capture.problem).toMatch(problem);
  });
});
