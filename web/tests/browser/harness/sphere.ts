/** A small capture for tests: a sphere of triangles that waves, and a coarser sphere around it as its cage. */

type Point = [number, number, number];

/** Meshes as `.obj` text, and frames as raw numbers. */
export class SphereCapture {
  readonly rest: string;
  readonly cage: string;
  readonly points: number;
  readonly #points: Point[];

  /** @param divisions how often the faces of an icosahedron are divided in four: 10·4^k + 2 points */
  constructor(divisions = 3) {
    const model = sphere(divisions);
    const cage = sphere(1);
    this.#points = model.points;
    this.points = model.points.length;
    this.rest = objOf(model.points, model.triangles);
    this.cage = objOf(
      cage.points.map((point) => point.map((x) => 1.4 * x) as Point),
      cage.triangles,
    );
  }

  /** Frames back to back, n × 3 numbers each. */
  frames(first: number, count: number): Float32Array<ArrayBuffer> {
    const out = new Float32Array(count * 3 * this.points);
    for (let k = 0; k < count; k += 1) {
      this.#points.forEach((point, i) => out.set(waved(point, first + k), 3 * (k * this.points + i)));
    }
    return out;
  }

  /** A NumPy file of the first frames. */
  npy(count: number): Uint8Array<ArrayBuffer> {
    const header = `{'descr': '<f4', 'fortran_order': False, 'shape': (${count}, ${this.points}, 3), }`;
    const padded = header.padEnd(Math.ceil((header.length + 11) / 64) * 64 - 11) + '\n';
    const head = Buffer.alloc(10);
    head.write('\x93NUMPY\x01\x00', 'latin1');
    head.writeUInt16LE(padded.length, 8);
    return Uint8Array.from(Buffer.concat([head, Buffer.from(padded), Buffer.from(this.frames(0, count).buffer)]));
  }

  /** A frame as `.obj` text. */
  frameObj(frame: number): string {
    return this.rest
      .replace(/^v .*$/gm, () => '')
      .trimStart()
      .replace(/^/, this.#points.map((point) => line(waved(point, frame))).join(''));
  }
}

/** A twist, a bend and a ripple finer than the cage, so that errors are not zero. */
function waved([x, y, z]: Point, frame: number): Point {
  const time = frame / 12;
  const turn = 0.6 * Math.sin(time) * y;
  const ripple = 1 + 0.01 * Math.sin(9 * x + time) * Math.cos(8 * z);
  const [c, s] = [Math.cos(turn), Math.sin(turn)];
  return [
    ripple * (c * x - s * z) + 0.3 * Math.sin(time) * y * y,
    ripple * y * (1 + 0.1 * Math.cos(time)),
    ripple * (s * x + c * z),
  ];
}

function objOf(points: Point[], triangles: Point[]): string {
  return (
    points.map(line).join('') +
    triangles.map((corners) => `f ${corners.map((corner) => corner + 1).join(' ')}\n`).join('')
  );
}

function line(point: Point): string {
  return `v ${point.map((x) => x.toFixed(6)).join(' ')}\n`;
}

function sphere(divisions: number): { points: Point[]; triangles: Point[] } {
  const g = (1 + Math.sqrt(5)) / 2;
  const points: Point[] = [];
  for (const [a, b] of [
    [1, g],
    [-1, g],
    [1, -g],
    [-1, -g],
  ] as const) {
    points.push(unit([0, a, b]), unit([a, b, 0]), unit([b, 0, a]));
  }
  let triangles = hullOf(points);
  for (let k = 0; k < divisions; k += 1) {
    const middles = new Map<string, number>();
    const middle = (a: number, b: number): number => {
      const key = a < b ? `${a} ${b}` : `${b} ${a}`;
      const known = middles.get(key);
      if (known !== undefined) return known;
      points.push(unit(points[a].map((x, axis) => x + points[b][axis]) as Point));
      middles.set(key, points.length - 1);
      return points.length - 1;
    };
    triangles = triangles.flatMap(([a, b, c]): Point[] => {
      const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
      return [
        [a, ab, ca],
        [ab, b, bc],
        [ca, bc, c],
        [ab, bc, ca],
      ];
    });
  }
  return { points, triangles };
}

/** Faces of an icosahedron: all triples of vertices next to each other, counter-clockwise from outside. */
function hullOf(points: Point[]): Point[] {
  const edge = Math.min(...points.slice(1).map((point) => distance(point, points[0])));
  const isEdge = (a: number, b: number): boolean => distance(points[a], points[b]) < 1.01 * edge;
  const triangles: Point[] = [];
  for (let a = 0; a < 12; a += 1) {
    for (let b = a + 1; b < 12; b += 1) {
      for (let c = b + 1; c < 12; c += 1) {
        if (!isEdge(a, b) || !isEdge(b, c) || !isEdge(a, c)) continue;
        triangles.push(volume(points[a], points[b], points[c]) > 0 ? [a, b, c] : [a, c, b]);
      }
    }
  }
  return triangles;
}

function volume(a: Point, b: Point, c: Point): number {
  return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

function distance(a: Point, b: Point): number {
  return Math.hypot(...a.map((x, axis) => x - b[axis]));
}

function unit(point: Point): Point {
  const length = Math.hypot(...point);
  return point.map((x) => x / length) as Point;
}
