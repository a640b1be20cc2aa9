import { beforeEach, describe, expect, it } from 'vitest';
import { editedRows } from './cageEdit';
import { EditModel, rangeAround } from './editModel';
import { angleOf, rotationAbout } from './motion';
import type { Vector } from '../coordinates/vector';

/** An octahedron. */
const cage = {
  positions: Float64Array.of(1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1),
  triangles: Uint32Array.of(0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5),
};
let model: EditModel;

const moved = (frame: number, frames: number, step?: string) => {
  const act = model.begin('move', frame, frames, step);
  return (by: Vector) => act({ kind: 'move', by });
};
/** Where the vertices of the rest cage are in a frame where the edit is whole. */
const offsetsOf = (frame: number) => {
  const rows = Float32Array.from(cage.positions);
  return [...editedRows(rows, frame, model.edits)].map((x, k) => x - rows[k]);
};

beforeEach(() => {
  model = new EditModel({ cage }, 2);
  model.settings = { radius: 0, measure: 'surface', symmetry: null, reach: 'around' };
});

describe('edits', () => {
  it('a drag is one step, whatever way it took', () => {
    model.selection = [2];
    const move = moved(20, 60);
    for (const x of [0.1, 0.7, 0.4]) move([x, 0, 0]);
    expect(model.edits).toHaveLength(1);
    expect(model.edits[0].motion).toEqual({ kind: 'move', by: [0.4, 0, 0] });
    expect(model.undo()).toBe(true);
    expect(model.edits).toEqual([]);
    expect(model.undo()).toBe(false);
    expect(model.redo()).toBe(true);
    expect(model.edits[0].motion).toEqual({ kind: 'move', by: [0.4, 0, 0] });
  });

  it('the same vertices again add to the same edit, as a step of their own', () => {
    model.selection = [2];
    moved(20, 60)([1, 0, 0]);
    moved(20, 60)([0, 1, 0]);
    expect(model.edits).toHaveLength(1);
    expect(offsetsOf(20).slice(6, 9)).toEqual([1, 1, 0]);
    model.undo();
    expect(offsetsOf(20).slice(6, 9)).toEqual([1, 0, 0]);
  });

  it('in a frame where the edit is not whole, and with other settings, a new edit begins', () => {
    model.selection = [2];
    moved(20, 60)([1, 0, 0]);
    moved(25, 60)([1, 0, 0]);
    model.settings = { ...model.settings, radius: 0.5 };
    moved(25, 60)([1, 0, 0]);
    expect(model.edits.map(({ range }) => range.first)).toEqual([8, 13, 13]);
  });

  it('rotations of the same vertices add up, and beside a movement they are an edit of their own', () => {
    model.selection = [2, 3];
    moved(20, 60)([1, 0, 0]);
    const quarter = { kind: 'rotate', rotation: rotationAbout([0, 0, 1], Math.PI / 2) } as const;
    model.begin('rotate', 20, 60)(quarter);
    model.begin('rotate', 20, 60)(quarter);
    expect(model.edits.map(({ motion }) => motion.kind)).toEqual(['move', 'rotate']);
    const { motion } = model.edits[1];
    expect(motion.kind === 'rotate' && angleOf(motion.rotation)).toBeCloseTo(Math.PI, 12);
    // The ends of the axis y, moved by one along x and then turned about each other.
    const expected = [1, -2, 0, 1, 2, 0];
    offsetsOf(20)
      .slice(6, 12)
      .forEach((x, k) => expect(x).toBeCloseTo(expected[k], 6));
  });

  it('edits that were kept are taken up below those there are, and can be taken back', () => {
    model.selection = [2];
    moved(20, 60)([1, 0, 0]);
    const kept = model.edits;
    moved(30, 60)([0, 1, 0]);
    const [, own] = model.edits;
    model.remove(kept[0].id);
    model.takeUp(kept);
    expect(model.edits.map(({ motion }) => motion)).toEqual([kept[0].motion, own.motion]);
    expect(new Set(model.edits.map(({ id }) => id)).size).toBe(2);
    model.undo();
    expect(model.edits).toEqual([own]);
  });

  it('key presses of one name are one step, until something else is chosen', () => {
    model.selection = [2];
    for (let k = 0; k < 3; k++) moved(20, 60, 'key 1')([0.5, 0, 0]);
    expect(offsetsOf(20)[6]).toBe(1.5);
    model.selection = [3];
    moved(20, 60, 'key 1')([1, 0, 0]);
    expect(model.edits).toHaveLength(2);
    model.undo();
    expect(model.edits).toHaveLength(1);
    model.undo();
    expect(model.edits).toEqual([]);
  });

  it('ranges, switching off, removing and resetting can be undone', () => {
    model.selection = [0, 2];
    moved(5, 60)([1, 0, 0]);
    const [{ id, range }] = model.edits;
    expect(range).toEqual({ first: 0, last: 17, easeIn: 5, easeOut: 12 });
    model.setRange(id, { first: 2, last: 900, easeIn: 1, easeOut: 2 }, 60);
    expect(model.active?.range).toEqual({ first: 2, last: 59, easeIn: 1, easeOut: 2 });
    model.setEnabled(id, false);
    model.remove(id);
    expect(model.active).toBeNull();
    model.undo();
    expect(model.edits[0].enabled).toBe(false);
    model.reset();
    expect(model.edits).toEqual([]);
    for (let k = 0; k < 3; k++) model.undo();
    expect(model.edits[0]).toMatchObject({ range, enabled: true });
  });

  it('know the planes that the cage is symmetric across', () => {
    expect([...model.mirrors.keys()]).toEqual(['x', 'y', 'z']);
    model.settings = { ...model.settings, symmetry: 'x' };
    model.selection = [0];
    moved(0, 1)([0.5, 0.5, 0]);
    expect(offsetsOf(0).slice(0, 6)).toEqual([0.5, 0.5, 0, -0.5, 0.5, 0]);
  });

  it('tell of every change', () => {
    let told = 0;
    model.onChange = () => told++;
    model.selection = [1];
    moved(0, 9)([1, 1, 1]);
    model.undo();
    expect(told).toBe(3);
  });
});

describe('the range of a new edit', () => {
  it.each([
    ['frame', 7, { first: 7, last: 7, easeIn: 0, easeOut: 0 }],
    ['all', 7, { first: 0, last: 29, easeIn: 0, easeOut: 0 }],
    ['around', 28, { first: 16, last: 29, easeIn: 12, easeOut: 1 }],
  ] as const)('%s in frame %i', (reach, frame, range) => {
    expect(rangeAround(frame, 30, reach)).toEqual(range);
  });
});
