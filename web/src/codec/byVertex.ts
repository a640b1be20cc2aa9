/** The items of a list that name each vertex: those of vertex v are `items[starts[v] … starts[v + 1])`, ascending. */
export interface ByVertex {
  readonly starts: Uint32Array;
  readonly items: Uint32Array;
}

/** Inverts a list of items of `size` vertices each. */
export function byVertex(vertices: ArrayLike<number>, size: number, points: number): ByVertex {
  const starts = new Uint32Array(points + 1);
  for (let k = 0; k < vertices.length; k++) starts[vertices[k] + 1]++;
  for (let v = 0; v < points; v++) starts[v + 1] += starts[v];
  const places = starts.slice();
  const items = new Uint32Array(vertices.length);
  for (let k = 0; k < vertices.length; k++) items[places[vertices[k]]++] = Math.floor(k / size);
  return { starts, items };
}
