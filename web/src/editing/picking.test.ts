import { Matrix4, PerspectiveCamera } from 'three';
import { describe, expect, it } from 'vitest';
import { constraintAt, gizmoAt, type Constraint } from './gizmo';
import { motionOf, type Point } from './gizmoDrag';
import { keyCommand, TOOL_KEYS } from './keys';
import { angleOf } from './motion';
import { SHORTCUTS } from '../viewer/shortcuts';
import { placedVertices, vertexAt, verticesWithin, vertexTowards } from './picking';
import { dot, norm, plus, sub, type Vector } from '../coordinates/vector';
import { Projection } from '../render/projection';

const [WIDTH, HEIGHT] = [800, 600];

function projection(eye: Vector = [1.5, 1, 3]): Projection {
  const camera = new PerspectiveCamera(40, WIDTH / HEIGHT, 0.1, 50);
  camera.position.set(...eye);
  camera.lookAt(0, 0, 0);
  camera.updateMatrixWorld();
  const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  return new Projection(matrix, WIDTH, HEIGHT);
}

/** An octahedron around the origin. */
const positions = [0.5, 0, 0, -0.5, 0, 0, 0, 0.5, 0, 0, -0.5, 0, 0, 0, 0.5, 0, 0, -0.5];
const triangles = Uint32Array.of(0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5);

describe('projection', () => {
  it('goes to the picture and back', () => {
    const view = projection();
    const point: Vector = [0.3, -0.2, 0.4];
    expect(norm(sub(view.point(view.place(point)!), point))).toBeLessThan(1e-9);
    const { origin, direction } = view.ray(view.place(point)!.x, view.place(point)!.y);
    const along = dot(sub(point, origin), direction);
    expect(norm(sub(plus(origin, direction, along), point))).toBeLessThan(1e-9);
    expect(view.place([4, 3, 9])).toBeNull();
  });

  it('knows right, up and away', () => {
    const { right, up, away } = projection([0, 0, 3]).axes([0, 0, 0]);
    expect(norm(sub(right, [1, 0, 0]))).toBeLessThan(1e-9);
    expect(norm(sub(up, [0, 1, 0]))).toBeLessThan(1e-9);
    expect(norm(sub(away, [0, 0, -1]))).toBeLessThan(1e-9);
  });
});

describe('picking', () => {
  const places = placedVertices(projection([0.3, 0.2, 3]), positions, triangles);

  it('takes the nearest vertex, and of two in one place that in front', () => {
    const ahead = placedVertices(projection([0, 0, 3]), positions, triangles);
    expect(ahead[5]!.isBehind).toBe(true);
    expect(vertexAt(ahead, WIDTH / 2, HEIGHT / 2, 12)).toBe(4);
    expect(vertexAt(places, places[2]!.x + 4, places[2]!.y - 3, 12)).toBe(2);
    expect(vertexAt(places, 5, 5, 12)).toBe(-1);
  });

  it('chooses what is in a box, whichever corner it begins at', () => {
    const { x, y } = places[0]!;
    const box = { fromX: x + 9, fromY: y + 9, toX: x - 9, toY: y - 9 };
    expect(verticesWithin(places, box)).toEqual([0]);
    expect(verticesWithin(places, { fromX: 0, fromY: 0, toX: WIDTH, toY: HEIGHT })).toHaveLength(6);
  });

  it('goes on in a direction of the picture', () => {
    expect(vertexTowards(places, 4, { x: 1, y: 0 })).toBe(0);
    expect(vertexTowards(places, 0, { x: 1, y: 0 })).toBe(-1);
  });
});

/** The way of a drag of the gizmo, in the scene's unit. */
function draggedBy(view: Projection, at: Vector, constraint: Constraint, from: Point, to: Point): Vector {
  const { motion } = motionOf(view, { kind: 'move', constraint, at, from, to, diagonal: 1 });
  return motion.kind === 'move' ? motion.by : [NaN, NaN, NaN];
}

describe('the gizmo', () => {
  const view = projection();
  const gizmo = gizmoAt(view, [0.1, 0.2, 0])!;

  it.each([0, 1, 2] as const)('arrow %i moves along its axis alone, as far as the pointer', (axis) => {
    const { tip, from } = gizmo.arrows[axis];
    expect(constraintAt(gizmo, (tip.x + from.x) / 2, (tip.y + from.y) / 2)).toEqual({ kind: 'axis', axis });
    const way = draggedBy(view, [0.1, 0.2, 0], { kind: 'axis', axis }, from, tip);
    [0, 1, 2].filter((k) => k !== axis).forEach((k) => expect(way[k]).toBe(0));
    const moved = view.place(plus(plus([0.1, 0.2, 0], way), sub(view.point(from), [0.1, 0.2, 0])))!;
    expect(Math.hypot(moved.x - tip.x, moved.y - tip.y)).toBeLessThan(1.5);
  });

  it('squares move across their axis, the middle in the plane of the picture', () => {
    const squares = gizmo.squares.filter(({ opacity }) => opacity > 0.5);
    expect(squares.map(({ axis }) => axis)).toEqual([0, 2]);
    for (const { axis, corners } of squares) {
      const [x, y] = [(corners[0].x + corners[2].x) / 2, (corners[0].y + corners[2].y) / 2];
      expect(constraintAt(gizmo, x, y)).toEqual({ kind: 'plane', axis });
      const way = draggedBy(view, [0.1, 0.2, 0], { kind: 'plane', axis }, { x, y }, { x: x + 20, y: y - 9 });
      expect(Math.abs(way[axis])).toBeLessThan(1e-9);
      expect(norm(way)).toBeGreaterThan(0.01);
    }
    const { middle } = gizmo;
    expect(constraintAt(gizmo, middle.x + 3, middle.y)).toEqual({ kind: 'picture' });
    const to = { x: middle.x + 40, y: middle.y - 25 };
    const way = draggedBy(view, [0.1, 0.2, 0], { kind: 'picture' }, middle, to);
    const moved = view.place(plus([0.1, 0.2, 0], way))!;
    expect(Math.hypot(moved.x - to.x, moved.y - to.y)).toBeLessThan(1e-6);
  });

  it('hides an arrow that is seen from its end', () => {
    const along = gizmoAt(projection([0, 0, 3]), [0, 0, 0])!;
    expect(along.arrows[2].opacity).toBe(0);
    expect(along.arrows[0].opacity).toBe(1);
    expect(constraintAt(gizmo, 5, 5)).toBeNull();
  });
});

describe('rotating and scaling', () => {
  const at: Vector = [0.1, 0.2, 0];
  const view = projection([0.4, 0.3, 3]);
  const drag = { at, diagonal: 1 } as const;

  it('a drag around a ring that is seen from the front turns as far as the pointer does, beyond half a turn too', () => {
    const about = { kind: 'axis', axis: 2 } as const;
    const around = (angle: number) => view.place(plus(at, [0.3 * Math.cos(angle), 0.3 * Math.sin(angle), 0]))!;
    let before = 0;
    for (let angle = 0; angle < 4; angle += 0.5) {
      const from = around(0);
      before = motionOf(view, { ...drag, kind: 'rotate', constraint: about, from, to: around(angle) }, before).amount;
      expect(before).toBeCloseTo(angle, 6);
    }
    const stepped = { ...drag, kind: 'rotate', constraint: about, from: around(0), to: around(0.5) } as const;
    expect(motionOf(view, stepped, 0, true).amount).toBeCloseTo(Math.PI / 6, 9);
  });

  it('a ring that is seen from its edge is pulled along, the way its front goes', () => {
    const gizmo = gizmoAt(view, at, 'rotate')!;
    const { middle } = gizmo;
    expect(constraintAt(gizmo, middle.x + 82, middle.y)).toEqual({ kind: 'picture' });
    const from = { x: middle.x, y: middle.y + 6 };
    const to = { x: from.x + 31, y: from.y };
    const { motion, amount } = motionOf(view, {
      ...drag,
      kind: 'rotate',
      constraint: { kind: 'axis', axis: 1 },
      from,
      to,
    });
    // About the axis upwards, what is in front goes to the right.
    expect(amount).toBeCloseTo(0.5, 1);
    expect(motion.kind === 'rotate' && motion.rotation[1]).toBeCloseTo(Math.sin(amount / 2), 9);
    expect(motion.kind === 'rotate' && angleOf(motion.rotation)).toBeCloseTo(amount, 9);
  });

  it('rings are hidden where they are behind the middle, and one can be taken', () => {
    const gizmo = gizmoAt(projection([2, 1.2, 2]), at, 'rotate')!;
    expect(gizmo.rings.map(({ points }) => points.some(({ isBehind }) => isBehind))).toEqual([true, true, true, false]);
    const { axis, points } = gizmo.rings[1];
    const [front] = points.filter(({ isBehind }) => !isBehind);
    expect(constraintAt(gizmo, front.x, front.y)).toEqual({ kind: 'axis', axis });
  });

  it('an arrow that is pulled to twice its distance doubles along its axis alone', () => {
    const gizmo = gizmoAt(view, at, 'scale')!;
    const constraint = { kind: 'axis', axis: 0 } as const;
    const [from, to] = [0.2, 0.4].map((x) => view.place(plus(at, [x, 0, 0]))!);
    const { motion, amount } = motionOf(view, { ...drag, kind: 'scale', constraint, from, to });
    expect(amount).toBeCloseTo(2, 6);
    expect(motion).toEqual({ kind: 'scale', factors: [amount, 1, 1] });
    const back = motionOf(view, { ...drag, kind: 'scale', constraint, from, to: { x: -900, y: from.y } });
    expect(back.amount).toBeGreaterThan(0);
    const { middle } = gizmo;
    const larger = motionOf(view, {
      ...drag,
      kind: 'scale',
      constraint: { kind: 'picture' },
      from: middle,
      to: { x: middle.x + 120, y: middle.y },
    });
    expect(larger.motion).toEqual({ kind: 'scale', factors: [2, 2, 2] });
  });
});

describe('keys', () => {
  const key = (name: string, more: Partial<KeyboardEvent> = {}) => ({
    key: name,
    shiftKey: false,
    ctrlKey: false,
    altKey: false,
    metaKey: false,
    ...more,
  });
  const chosen = { isInPicture: true, hasSelection: true };

  it('undo and do again everywhere', () => {
    const elsewhere = { isInPicture: false, hasSelection: false };
    expect(keyCommand(key('z', { ctrlKey: true }), elsewhere)).toEqual({ kind: 'undo' });
    expect(keyCommand(key('Z', { metaKey: true, shiftKey: true }), elsewhere)).toEqual({ kind: 'redo' });
    expect(keyCommand(key('ArrowLeft'), elsewhere)).toBeNull();
    expect(keyCommand(key('c', { ctrlKey: true }), elsewhere)).toBeNull();
  });

  it('choose what is done, with letters that do nothing else in the viewer', () => {
    expect(keyCommand(key('R'), { ...chosen, hasSelection: false })).toEqual({ kind: 'tool', tool: 'rotate' });
    const taken = SHORTCUTS.flatMap(({ entries }) => entries.flatMap(({ keys }) => keys));
    expect(Object.values(TOOL_KEYS).filter((letter) => taken.includes(letter))).toEqual([]);
  });

  it('leave Tab to the page while nothing is chosen', () => {
    expect(keyCommand(key('Tab'), { ...chosen, hasSelection: false })).toBeNull();
    expect(keyCommand(key('Tab'), chosen)).toEqual({ kind: 'step', by: 1 });
    expect(keyCommand(key('Tab', { shiftKey: true }), chosen)).toEqual({ kind: 'step', by: -1 });
    expect(keyCommand(key('Escape'), chosen)).toEqual({ kind: 'clear' });
    expect(keyCommand(key('Escape'), { ...chosen, hasSelection: false })).toEqual({ kind: 'leave' });
  });

  it('arrows move, with Alt go to a neighbour, and choose where nothing is chosen', () => {
    expect(keyCommand(key('ArrowUp'), chosen)).toMatchObject({ kind: 'nudge', up: 1, right: 0 });
    expect(keyCommand(key('ArrowDown', { altKey: true }), chosen)).toEqual({ kind: 'towards', x: 0, y: 1 });
    expect(keyCommand(key('ArrowUp'), { ...chosen, hasSelection: false })).toEqual({ kind: 'enter' });
    expect(keyCommand(key('s'), chosen)).toBeNull();
  });
});
