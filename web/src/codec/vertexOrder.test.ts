import { expect, it } from 'vitest';
import { randomNumbers } from '../../tests/support/containers';
import { adjacency } from './polygons';
import { RecencyList } from './vertexOrder';

it('vertices that are moved stand in front in the order in which they stood', () => {
  const random = randomNumbers(9);
  const points = 200;
  const list = new RecencyList(points);
  let plain = Array.from({ length: points }, (_, vertex) => vertex);
  while (plain.length > 0) {
    const place = random(plain.length);
    expect(list.take(place)).toBe(plain.splice(place, 1)[0]);
    expect(list.take(plain.length)).toBeNull();
    const chosen = Uint32Array.from({ length: random(40) }, () => random(points));
    list.choose(chosen, 0, chosen.length);
    list.moveChosen();
    plain = [...plain.filter((vertex) => chosen.includes(vertex)), ...plain.filter((v) => !chosen.includes(v))];
  }
});

it('neighbours are those at the other ends of edges, each once', () => {
  const faces = {
    counts: Uint32Array.of(3, 4, 1, 2, 3),
    corners: Uint32Array.of(0, 1, 2, 2, 1, 3, 4, 5, 6, 0, 2, 2, 1),
  };
  const { starts, items } = adjacency(faces, 8);
  const of = (vertex: number) => [...items.subarray(starts[vertex], starts[vertex + 1])].sort();
  expect(Array.from({ length: 8 }, (_, vertex) => of(vertex))).toEqual([
    [1, 2, 6],
    [0, 2, 3],
    [0, 1, 4],
    [1, 4],
    [2, 3],
    [],
    [0],
    [],
  ]);
  expect(starts[8]).toBe(items.length);
});
