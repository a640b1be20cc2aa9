import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { pngOf } from '../support/png';
import { openPage } from './harness/browser';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';
import { dropOnViewer, inViewer, whenShown } from './harness/viewing';

const sphere = new SphereCapture(2);
/** Red on the left, green on the right. */
const picture = pngOf(16, 16, (x) => (x < 8 ? [255, 0, 0, 255] : [0, 200, 0, 255]));
const library = 'newmtl painted\nKd 0.8 0.8 0.8\nmap_Kd painted.png\n';

/** The sphere with a texture that is seen from the front as it is. */
const painted = ((): string => {
  const lines = sphere.rest.trim().split('\n');
  const points = lines.filter((line) => line.startsWith('v '));
  const faces = lines.filter((line) => line.startsWith('f '));
  const uvs = points.map((line) => {
    const [x, y] = line.split(' ').slice(1).map(Number);
    return `vt ${((x + 1) / 2).toFixed(5)} ${((y + 1) / 2).toFixed(5)}`;
  });
  const named = faces.map((line) => line.replace(/\d+/g, (number) => `${number}/${number}`));
  return ['mtllib rest.mtl', 'o ball', ...points, ...uvs, 'usemtl painted', ...named].join('\n') + '\n';
})();

describe.skipIf(missing)('materials that the program encodes', { timeout: 120_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start();
  }, 120_000);

  afterAll(() => site.close());

  const hasMaterials = (page: Page) => page.getByRole('button', { name: 'Materials', exact: true });

  test('are shown with their pictures', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/file?frame=0`);
    await dropOnViewer(page, { 'ball.cager': await encoded() });
    await whenShown(page);
    await hasMaterials(page).waitFor();
    await expect.poll(() => halves(page)).toEqual(['red', 'green']);
    expect(errors).toEqual([]);
    await close();
  });

  test('are there while a session runs', async () => {
    const client = site.client();
    const { id } = await client.create({ rest: painted, cage: sphere.cage }, { name: 'painted' });
    await client.whenReady(id);
    await client.post(id, sphere, 0, 2);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/session/${id}`);
    await whenShown(page);
    await hasMaterials(page).waitFor();
    expect(errors).toEqual([]);
    await close();
  });
});

/** A capture of the sphere with its picture in it. */
async function encoded(): Promise<Uint8Array<ArrayBuffer>> {
  const folder = await mkdtemp(join(tmpdir(), 'cager-web-'));
  const at = (name: string) => join(folder, name);
  try {
    await writeFile(at('rest.obj'), painted);
    await writeFile(at('rest.mtl'), library);
    await writeFile(at('painted.png'), picture);
    await writeFile(at('cage.obj'), sphere.cage);
    await writeFile(at('frames.npy'), sphere.npy(2));
    const inputs = ['--rest', at('rest.obj'), '--cage', at('cage.obj'), '--frames', at('frames.npy')];
    const options = ['--textures', 'embed', '--max-error', '0.001', '-o', at('ball.cager')];
    execFileSync(cager!, ['encode', '--quiet', ...inputs, ...options], { stdio: ['ignore', 'ignore', 'inherit'] });
    return Uint8Array.from(await readFile(at('ball.cager')));
  } finally {
    await rm(folder, { recursive: true, force: true });
  }
}

/** The colours a little to the left and to the right of the middle of the model. */
function halves(page: Page): Promise<string[]> {
  return inViewer(
    page,
    async (viewer) => {
      const bitmap = await createImageBitmap(await viewer.player!.picture());
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
      context.drawImage(bitmap, 0, 0);
      const { data, width } = context.getImageData(0, 0, bitmap.width, bitmap.height);
      const places: Record<string, number[]> = { red: [], green: [] };
      for (let k = 0; k < data.length; k += 4) {
        const [r, g, b] = data.subarray(k, k + 3);
        if (r > 1.7 * g && r > 1.7 * b) places.red.push((k / 4) % width);
        else if (g > 1.7 * r && g > 1.7 * b) places.green.push((k / 4) % width);
      }
      const mean = (list: number[]) => list.reduce((sum, x) => sum + x, 0) / list.length;
      return Object.keys(places)
        .filter((name) => places[name].length > 100)
        .sort((a, b) => mean(places[a]) - mean(places[b]));
    },
    null,
  );
}
