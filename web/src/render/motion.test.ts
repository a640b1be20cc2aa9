import { existsSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { describe, expect, it } from 'vitest';
import type { Capture } from '../capture';
import { parseNpy } from '../../tests/browser/npy';
import { diagonalOf, middleOf } from '../coordinates/topology';
import { axesOf, eyeOf, FIELD_OF_VIEW, framed, HOME, shifted, type CameraState } from './camera';
import { farthestPoints, Motion, surveyMotion } from './motion';

/** Pictures as wide and as high as those of desktops and a phone. */
const SIZES = [
  [1440, 900],
  [1280, 800],
  [390, 844],
] as const;
const REACH = 15;

/** Real captures, where they are at hand. */
const captures = process.env.CAGER_CAPTURES ?? fileURLToPath(new URL('../../../../shared/data', import.meta.url));

describe('the motion of a capture', () => {
  it.each(SIZES)('is framed with all points of a walker that turns, at %d × %d', (width, height) => {
    isInPicture(walker(), [[width, height]]);
  });

  it.each(
    ['samba', 'makehuman-cmu-walk', 'horse-gallop', 'anny-man-02_02'].filter((name) =>
      existsSync(`${captures}/${name}`),
    ),
  )('is framed with all points of %s, and followed', (name) => {
    const { shape, values } = parseNpy(readFileSync(`${captures}/${name}/frames.npy`));
    const frames = Array.from({ length: shape[0] }, (_, k) =>
      values.subarray(3 * shape[1] * k, 3 * shape[1] * (k + 1)),
    );
    isInPicture(frames, SIZES);
  });

  it('is unknown until the coordinates are there, and of cages where there are none', () => {
    const cages = Float32Array.of(0, 0, 0, 1, 0, 0, 10, 0, 0, 11, 0, 0);
    const motion = new Motion(2, 2, [0, 0, 0], {
      columns: 2,
      valuesOf: (rows) => Float64Array.from(rows),
      place: () => undefined,
    });
    motion.include({ first: 0, count: 2, cages, residual: null });
    expect([motion.isEmpty, motion.knows(1), motion.knows(2)]).toEqual([true, true, false]);
    motion.setPhi(null);
    expect(Math.max(...motion.corners(null))).toBe(11);
    expect(motion.centreAt(0.5, 1)[0]).toBe(5.5);
  });
});

/** Fails where a point of a frame is out of the picture; the first frame is taken for the rest pose. */
function isInPicture(frames: readonly ArrayLike<number>[], sizes: readonly (readonly [number, number])[]) {
  const [diagonal, middle] = [diagonalOf(Float64Array.from(frames[0])), middleOf(Float64Array.from(frames[0]))];
  const place = (positions: Float32Array | Float64Array) =>
    positions.forEach((value, k) => (positions[k] = (value - middle[k % 3]) / diagonal));
  const motion = motionOf(frames, place);
  const looks = sizes.flatMap(([width, height]) =>
    [null, REACH].map((reach) => {
      const aspect = width / height;
      return { aspect, reach, camera: framed(HOME, motion.corners(reach), aspect), farthest: 0 };
    }),
  );
  for (const [frame, positions] of frames.entries()) {
    const placed = Float64Array.from(positions);
    place(placed);
    for (const look of looks) {
      const { reach, camera, aspect } = look;
      const there = reach === null ? camera : shifted(camera, motion.centreAt(frame, reach));
      look.farthest = Math.max(look.farthest, outermost(placed, there, aspect));
    }
  }
  for (const { farthest } of looks) {
    expect(farthest).toBeLessThan(1);
    expect(farthest).toBeGreaterThan(0.5);
  }
}

/** A motion of samples that are columns of their own: Φ has a one for each of them. */
function motionOf(frames: readonly ArrayLike<number>[], place: (positions: Float32Array) => void): Motion {
  const samples = farthestPoints(frames[0], 192);
  const columns = samples.length;
  const motion = new Motion(columns, 0, frames[0], { columns, valuesOf: (rows) => Float64Array.from(rows), place });
  const phi = new Float32Array((frames[0].length / 3) * columns);
  samples.forEach((point, k) => (phi[point * columns + k] = 1));
  motion.setPhi(phi);
  const cages = new Float32Array(3 * columns * frames.length);
  for (const [frame, positions] of frames.entries())
    samples.forEach((point, k) => {
      for (let axis = 0; axis < 3; axis++) cages[3 * (columns * frame + k) + axis] = positions[3 * point + axis];
    });
  motion.include({ first: 0, count: frames.length, cages, residual: null });
  return motion;
}

describe('surveyMotion', () => {
  it.each([
    { first: 0, before: [0, 8, 4], after: [2, 6, 1, 3, 5, 7] },
    { first: 5, before: [5, 0, 8, 4], after: [2, 6, 1, 3, 7] },
  ])('reads the ends and the middle before frame $first is decoded, and what lies between after it', async (reads) => {
    const capture = { complete: true, frames: 9 } as Capture;
    const known = new Set([reads.first]);
    let state: 'buffering' | 'preparing' | 'ready' = 'preparing';
    const survey = surveyMotion(
      capture,
      { knows: (frame) => known.has(frame) },
      (frame) => Promise.resolve(known.add(frame)),
      () => state,
      new AbortController().signal,
    );
    await new Promise((resolve) => setTimeout(resolve, 50));
    expect([...known]).toEqual(reads.before);
    state = 'ready';
    await survey;
    expect([...known]).toEqual([...reads.before, ...reads.after]);
  });
});

/** How far out the outermost point is: 1 is the border of the picture. */
function outermost(points: Float64Array, camera: CameraState, aspect: number): number {
  const { right, up, back } = axesOf(camera);
  const eye = eyeOf(camera);
  const slope = Math.tan(FIELD_OF_VIEW / 2);
  let farthest = 0;
  for (let at = 0; at < points.length; at += 3) {
    const [x, y, z] = [points[at] - eye[0], points[at + 1] - eye[1], points[at + 2] - eye[2]];
    const along = (axis: readonly number[]) => axis[0] * x + axis[1] * y + axis[2] * z;
    const depth = -slope * along(back);
    if (depth <= 0) return Infinity;
    farthest = Math.max(farthest, Math.abs(along(up)) / depth, Math.abs(along(right)) / (depth * aspect));
  }
  return farthest;
}

/** An upright body with arms that swings them, goes ten of its heights and turns. */
function walker(): Float64Array[] {
  return Array.from({ length: 90 }, (_, frame) => {
    const [way, turn, swing] = [frame / 9, frame / 30, Math.sin(frame / 4)];
    const points: number[] = [];
    for (let k = 0; k < 3000; k++) {
      const [part, along, around] = [k % 3, (k * 0.618) % 1, k * 2.4];
      const [x, y, z] =
        part === 0
          ? [0.15 * Math.cos(around), 2 * along - 1, 0.1 * Math.sin(around)]
          : [
              (part === 1 ? 1 : -1) * (0.2 + 0.02 * Math.cos(around)),
              0.6 - along * 0.8,
              along * 0.8 * swing * (part - 1.5),
            ];
      points.push(x * Math.cos(turn) + z * Math.sin(turn) + 2 * way, y, z * Math.cos(turn) - x * Math.sin(turn));
    }
    return Float64Array.from(points);
  });
}
