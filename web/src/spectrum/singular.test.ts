import { expect, test } from 'vitest';
import { goldenBytes, openBytes } from '../container/testSupport';
import { computeCoordinates } from '../coordinates/compute';
import { gramOf } from './gramOf';
import { spectrumOf, vectorOf } from './singular';

/** Singular values below this part of the largest are moved by rounding. */
const WELL_CONDITIONED = 1e-4;

async function golden(name: string) {
  const { static: part } = await openBytes(goldenBytes(name));
  const request = { system: part.system, cage: part.cage, rest: part.rest, rows: part.rowsPerFrame, phi: null };
  return {
    part,
    request,
    spectrum: spectrumOf(
      gramOf(request, () => undefined),
      part.rest.length / 3,
    ),
  };
}

test.each(['definition3-mvc', 'definition3-green-free'])(
  '%s has the singular values that its report stores',
  async (name) => {
    const { part, spectrum } = await golden(name);
    const expected = (part.report as { singular_values: number[] }).singular_values;
    expect(spectrum.values).toHaveLength(expected.length);
    let compared = 0;
    for (const [k, value] of expected.entries()) {
      if (value < WELL_CONDITIONED * expected[0]) continue;
      compared++;
      expect(Math.abs(spectrum.values[k] - value) / value, `value ${k}`).toBeLessThan(1e-6);
    }
    expect(compared).toBeGreaterThan(25);
  },
);

test('a_vector_is_of_length_one_and_stretched_by_its_value', async () => {
  const { part, spectrum } = await golden('definition3-mvc');
  const phi = computeCoordinates(part.system, part.cage, part.rest);
  const n = spectrum.values.length;
  for (const k of [0, 12, n - 1]) {
    const vector = vectorOf(spectrum, k);
    expect(Math.hypot(...vector)).toBeCloseTo(1, 12);
    expect(Math.max(...vector)).toBe(Math.max(...vector.map(Math.abs)));
    const image = Array.from({ length: phi.length / n }, (_, point) =>
      vector.reduce((sum, entry, row) => sum + entry * phi[point * n + row], 0),
    );
    expect(Math.hypot(...image) / spectrum.values[k]).toBeCloseTo(1, 9);
  }
});

test('coordinates_that_come_from_a_service_give_the_same_values_within_their_rounding', async () => {
  const { part, request, spectrum } = await golden('definition3-mvc');
  const phi = Float32Array.from(computeCoordinates(part.system, part.cage, part.rest));
  const rounded = spectrumOf(
    gramOf({ ...request, phi }, () => undefined),
    part.rest.length / 3,
  );
  for (const [k, value] of spectrum.values.entries()) expect(rounded.values[k] / value).toBeCloseTo(1, 5);
});

test('values_of_a_sample_are_scaled_to_all_points', async () => {
  const { request, spectrum } = await golden('definition3-mvc');
  const sampled = spectrumOf(
    gramOf(request, () => undefined),
    (4 * request.rest.length) / 3,
  );
  expect(sampled.values[0]).toBeCloseTo(2 * spectrum.values[0], 9);
});
