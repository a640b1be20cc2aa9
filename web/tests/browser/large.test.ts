import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { beforeAll, describe, expect, test } from 'vitest';
import { diagonalOf } from '../../src/coordinates/topology';
import { npyHeader } from '../../src/editing/exporter';
import { pretendGraphics } from './harness/device';
import { cager, missing } from './harness/programs';
import { SphereCapture } from './harness/sphere';
import { dropOnViewer, FilePages, inViewer, whenShown } from './harness/viewing';
import { type NpyArray, parseNpy } from './npy';

/** Points around the model, and from its one end to the other. */
const [AROUND, ALONG] = [160, 125];
const FRAMES = 3;

describe.skipIf(missing)('a capture of 20,000 points', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();
  let container: Uint8Array;
  let decoded: NpyArray;

  beforeAll(() => {
    const folder = mkdtempSync(join(tmpdir(), 'cager-large-'));
    const path = (name: string) => join(folder, name);
    const run = (...args: string[]) =>
      execFileSync(cager!, [...args, '--quiet'], { stdio: ['ignore', 'ignore', 'inherit'] });
    const frames = Array.from(
      { length: FRAMES },
      (_, frame) => new Uint8Array(Float32Array.from(points(frame).flat()).buffer),
    );
    try {
      writeFileSync(path('rest.obj'), model());
      writeFileSync(path('cage.obj'), new SphereCapture(1).cage);
      writeFileSync(path('frames.npy'), Buffer.concat([npyHeader([FRAMES, AROUND * ALONG, 3]), ...frames]));
      const [rest, cage, output] = [path('rest.obj'), path('cage.obj'), path('large.cager')];
      run('encode', '--rest', rest, '--cage', cage, '--frames', path('frames.npy'), '-o', output);
      run('decode', output, '-o', path('decoded.npy'));
      container = readFileSync(output);
      decoded = parseNpy(readFileSync(path('decoded.npy')));
    } finally {
      rmSync(folder, { recursive: true });
    }
  }, 90_000);

  test.each([
    ['by_shaders_with_parts_of_the_coordinates_side_by_side', true, 16],
    ['in_the_page_where_no_graphics_processor_is', false, 32],
  ])('is_decoded_%s_to_what_the_program_decodes', async (_, hasGraphics, bits) => {
    const page = await pages.open({}, '#/file?frame=0');
    // Less than the height of Φ, and what every device with WebGL 2 has.
    if (hasGraphics) await pretendGraphics(page, 2048);
    await dropOnViewer(page, { 'large.cager': container });
    await whenShown(page);
    expect(await inViewer(page, (viewer) => viewer.player!.stage.decoder.precision.bits, null)).toBe(bits);
    const length = 3 * decoded.shape[1];
    const diagonal = diagonalOf(decoded.values.subarray(0, length));
    for (const frame of [0, FRAMES - 1]) {
      const expected = Buffer.from(
        Float32Array.from(decoded.values.subarray(frame * length, (frame + 1) * length)).buffer,
      );
      const farthest = await inViewer(
        page,
        async (viewer, { frame, base64 }) => {
          const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
          const wanted = new Float32Array(bytes.buffer);
          const found = await viewer.readPositions(frame);
          return found.length === wanted.length
            ? found.reduce((most, x, k) => Math.max(most, Math.abs(x - wanted[k])), 0)
            : NaN;
        },
        { frame, base64: expected.toString('base64') },
      );
      expect(farthest / diagonal).toBeLessThan(1e-4);
    }
    expect(pages.errors).toEqual([]);
  });
});

/** Points of a frame: an ellipsoid without its poles that grows longer, and bulges in a way that the cage cannot follow. */
function points(frame: number): [number, number, number][] {
  return Array.from({ length: AROUND * ALONG }, (_, k) => {
    const turn = (2 * Math.PI * (k % AROUND)) / AROUND;
    const height = (Math.PI * (Math.floor(k / AROUND) + 0.5)) / ALONG;
    const radius = Math.sin(height) * (1 + 0.01 * frame * Math.sin(8 * turn));
    return [radius * Math.cos(turn), (1 + 0.1 * frame) * Math.cos(height), radius * Math.sin(turn)];
  });
}

/** The rest pose as `.obj` text, with quadrilaterals. */
function model(): string {
  const places = points(0).map((point) => `v ${point.map((x) => x.toFixed(6)).join(' ')}\n`);
  const faces = Array.from({ length: AROUND * (ALONG - 1) }, (_, k) => {
    const next = k % AROUND === AROUND - 1 ? k + 1 - AROUND : k + 1;
    return `f ${[k, next, next + AROUND, k + AROUND].map((point) => point + 1).join(' ')}\n`;
  });
  return places.join('') + faces.join('');
}
