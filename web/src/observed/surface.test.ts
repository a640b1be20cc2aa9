import { expect, test } from 'vitest';
import { readSurface, NearestSurface } from './surface';

/** Numbers that look random, the same every time. */
function numbers(count: number): Float32Array {
  let state = 1;
  return Float32Array.from({ length: count }, () => (state = (48_271 * state) % 2_147_483_647) / 2_147_483_647);
}

test('distances_from_a_cloud_are_those_from_its_nearest_points', () => {
  const [points, places] = [numbers(3 * 500), numbers(3 * 60).map((x) => 2 * x - 0.5)];
  // Points that are nowhere are passed over.
  points[30] = NaN;
  const found = new NearestSurface({ points, triangles: new Uint32Array(0) }).distances(places);
  for (let k = 0; k < found.length; k++) {
    let nearest = Infinity;
    for (let p = 0; p < points.length; p += 3) {
      const distance = Math.hypot(...[0, 1, 2].map((axis) => points[p + axis] - places[3 * k + axis]));
      if (distance < nearest) nearest = distance;
    }
    expect(found[k]).toBeCloseTo(nearest, 6);
  }
});

test('distances_from_a_mesh_are_those_from_its_faces', async () => {
  // A grid of quads in the plane z = 0, from 0 to 4.
  const lines = Array.from({ length: 25 }, (_, p) => `v ${p % 5} ${Math.floor(p / 5)} 0`);
  for (let p = 0; p < 19; p++)
    if (p % 5 < 4) lines.push(`f ${[p, p + 1, p + 6, p + 5].map((q) => `${q + 1}//1`).join(' ')}`);
  const surface = await readSurface(new File([lines.join('\n')], 'grid.obj'));
  expect(surface.triangles.length / 3).toBe(32);
  const found = new NearestSurface(surface).distances(Float32Array.of(1.4, 2.7, 0.25, 6, 4, 0));
  expect([...found]).toEqual([0.25, 2]);
});

test('meshes_are_read_as_ply_and_obj_with_corners_that_count_back', async () => {
  const head = 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n';
  const ply = `${head}element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n`;
  const obj = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 7 7 7\nf 1 2 9\n';
  const read = await Promise.all([readSurface(new File([ply], 'a.ply')), readSurface(new File([obj], 'a.obj'))]);
  expect(read.map(({ triangles }) => [...triangles])).toEqual([
    [0, 1, 2],
    [0, 1, 2],
  ]);
  expect([...read[0].points]).toEqual([0, 0, 0, 1, 0, 0, 0, 1, 0]);
  await expect(readSurface(new File(['nothing'], 'b.ply'))).rejects.toThrow(/^b\.ply: /);
});

test('no_surface_is_at_no_distance', () => {
  const empty = { points: new Float32Array(0), triangles: new Uint32Array(0) };
  expect(new NearestSurface(empty).distances(Float32Array.of(1, 2, 3))[0]).toBeNaN();
});
