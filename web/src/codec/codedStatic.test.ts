import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { parseHead } from '../container/head';
import { parseFields } from '../container/section';
import { openBytes, randomNumbers, takeApart } from '../../tests/support/containers';
import { diagonalOf } from '../coordinates/topology';
import { decodeFaces } from './connectivity';
import { CodedDataError } from './error';
import { decodeFrameErrors } from './frameErrors';
import { decodePositions } from './positions';

const read = (name: string) => new Uint8Array(readFileSync(new URL(`testdata/${name}`, import.meta.url)));

function payloadsOf(name: string): Map<string, Uint8Array> {
  return new Map(takeApart(read(name)).map(({ header, payload }) => [parseFields(header, 0).tag, payload]));
}

it('a mesh that is numbered every second vertex first comes back', async () => {
  const { static: part } = await openBytes(read('chessboard.cager'));
  const side = 14;
  const cells = Array.from({ length: side * side }, (_, k) => [Math.floor(k / side), k % side]);
  cells.sort(([i, j], [k, l]) => ((i + j) % 2) - ((k + l) % 2) || i - k || j - l);
  const numbers = new Map(cells.map(([i, j], number) => [side * i + j, number]));
  const expected = cells.flatMap(([i, j]) => [i / 8 - 0.8, j / 8 - 0.8, 0.2 * Math.sin(i / 3)]);
  const farthest = expected.reduce((far, x, k) => Math.max(far, Math.abs(x - part.rest[k])), 0);
  expect(part.rest.length).toBe(expected.length);
  expect(farthest / diagonalOf(part.rest)).toBeLessThan(5e-4);
  const at = (i: number, j: number) => numbers.get(side * i + j)!;
  const faces = new Set<string>();
  for (let i = 0; i + 1 < side; i++) {
    for (let j = 0; j + 1 < side; j++) {
      faces.add(named([at(i, j), at(i + 1, j), at(i, j + 1)]));
      faces.add(named([at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]));
    }
  }
  const found = Array.from({ length: part.cornerCounts.length }, (_, k) => [
    ...part.corners.subarray(3 * k, 3 * k + 3),
  ]);
  expect(new Set(found.map(named))).toEqual(faces);
  expect(found.length).toBe(faces.size);
});

/** The corners of a triangle in their order, beginning with the smallest. */
function named(face: number[]): string {
  const first = face.indexOf(Math.min(...face));
  return [...face.slice(first), ...face.slice(0, first)].join(' ');
}

describe('the errors of frames', () => {
  const payload = payloadsOf('connected.cager').get('ERRS')!;

  it('are those that the program reads', () => {
    const { l2, linf } = decodeFrameErrors(payload, 6);
    // `cager inspect --json`.
    const expected = [
      [0.0006213188171386719, 0.0009937286376953125],
      [0.0006222724914550781, 0.0009894371032714844],
      [0.0006248950958251953, 0.0009903907775878906],
      [0.0006198883056640625, 0.0009975433349609375],
      [0.0006449222564697266, 0.0009837150573730469],
      [0.0005900859832763672, 0.0009951591491699219],
    ];
    expect(Array.from(l2, (x, k) => [x, linf[k]])).toEqual(expected);
  });

  it('of more frames than there are, are an error', () => {
    expect(() => decodeFrameErrors(payload, 100_000)).toThrow(CodedDataError);
  });
});

it.each(['connected.cager', 'chessboard.cager'])(
  'damage of the static sections of %s is an error or numbers of the mesh',
  (name) => {
    const payloads = payloadsOf(name);
    const { points, restFaces, restCorners } = parseHead(payloads.get('HEAD')!, 0);
    const [faces, positions, errors] = ['RFAC', 'RPTS', 'ERRS'].map((tag) => payloads.get(tag)!);
    const polygons = decodeFaces(faces, points, restFaces, restCorners);
    const attempt = <T>(decode: () => T, check: (found: T) => void) => {
      try {
        check(decode());
      } catch (error) {
        expect(error).toBeInstanceOf(CodedDataError);
      }
    };
    const attemptAll = (change: (bytes: Uint8Array) => Uint8Array) => {
      attempt(
        () => decodeFaces(change(faces), points, restFaces, restCorners),
        ({ counts, corners }) => {
          expect(counts.reduce((sum, count) => sum + count, 0)).toBe(corners.length);
          expect(corners.every((vertex) => vertex < points)).toBe(true);
        },
      );
      attempt(
        () => decodePositions(change(positions), polygons, points),
        (found) => expect(found.length).toBe(3 * points),
      );
      attempt(
        () => decodeFrameErrors(change(errors), 6),
        ({ l2, linf }) => expect([...l2, ...linf].some((error) => error < 0)).toBe(false),
      );
    };
    const random = randomNumbers(5);
    for (let turn = 0; turn < 60; turn++) {
      attemptAll((bytes) => bytes.subarray(0, random(bytes.length)));
      attemptAll((bytes) => bytes.subarray(0, 4 * random(bytes.length >> 2)));
      attemptAll((bytes) => {
        const changed = bytes.slice();
        changed[random(bytes.length)] ^= 1 << random(8);
        return changed;
      });
    }
    expect(() => decodeFaces(faces, points, restFaces + 1, restCorners)).toThrow(CodedDataError);
    expect(() => decodeFaces(faces, points, restFaces, restCorners - 1)).toThrow(CodedDataError);
  },
);
