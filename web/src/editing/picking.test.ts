import { Matrix4, PerspectiveCamera } from 'three';
import { describe, expect, it } from 'vitest';
import { constraintAt, draggedBy, gizmoAt } from './gizmo';
import { keyCommand } from './keys';
import { placedVertices, vertexAt, verticesWithin, vertexTowards } from './picking';
import { dot, length, minus, plus, Projection, type Vector } from './projection';

const [WIDTH, HEIGHT] = [800, 600];

function projection(eye: Vector = [1.5, 1, 3]): Projection {
  const camera = new PerspectiveCamera(40, WIDTH / HEIGHT, 0.1, 50);
  camera.position.set(...eye);
  camera.lookAt(0, 0, 0);
  camera.updateMatrixWorld();
  const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  return new Projection(matrix.elements, WIDTH, HEIGHT);
}

/** An octahedron around the origin. */
const positions = [0.5, 0, 0, -0.5, 0, 0, 0, 0.5, 0, 0, -0.5, 0, 0, 0, 0.5, 0, 0, -0.5];
const triangles = Uint32Array.of(0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5);

describe('projection', () => {
  it('goes to the picture and back', () => {
    const view = projection();
    const point: Vector = [0.3, -0.2, 0.4];
    expect(length(minus(view.point(view.place(point)!), point))).toBeLessThan(1e-9);
    const { origin, direction } = view.ray(view.place(point)!.x, view.place(point)!.y);
    const along = dot(minus(point, origin), direction);
    expect(length(minus(plus(origin, direction, along), point))).toBeLessThan(1e-9);
    expect(view.place([4, 3, 9])).toBeNull();
  });

  it('knows right, up and away', () => {
    const { right, up, away } = projection([0, 0, 3]).axes([0, 0, 0]);
    expect(length(minus(right, [1, 0, 0]))).toBeLessThan(1e-9);
    expect(length(minus(up, [0, 1, 0]))).toBeLessThan(1e-9);
    expect(length(minus(away, [0, 0, -1]))).toBeLessThan(1e-9);
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

describe('the gizmo', () => {
  const view = projection();
  const gizmo = gizmoAt(view, [0.1, 0.2, 0])!;

  it.each([0, 1, 2] as const)('arrow %i moves along its axis alone, as far as the pointer', (axis) => {
    const { tip, from } = gizmo.arrows[axis];
    expect(constraintAt(gizmo, (tip.x + from.x) / 2, (tip.y + from.y) / 2)).toEqual({ kind: 'axis', axis });
    const way = draggedBy(view, [0.1, 0.2, 0], { kind: 'axis', axis }, from, tip);
    [0, 1, 2].filter((k) => k !== axis).forEach((k) => expect(way[k]).toBe(0));
    const moved = view.place(plus(plus([0.1, 0.2, 0], way), minus(view.point(from), [0.1, 0.2, 0])))!;
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
      expect(length(way)).toBeGreaterThan(0.01);
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
