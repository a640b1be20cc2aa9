import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { openBytes } from '../support/containers';
import { diagonalOf } from '../../src/coordinates/topology';
import { seriousFindings } from './harness/axe';
import { openPage } from './harness/browser';
import { chromium, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';
import { dropOnViewer, FilePages, goldenBytes, inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

/** How far the observed points of frame k are from the model, in diagonals: (k + 1) times this. */
const STEP = 1e-4;
const PHONE = { width: 390, height: 844 };

describe.skipIf(chromium === undefined)('a recovery in files', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();

  it('marks lost frames and shows scores of a report that is dropped with its container', async () => {
    const page = await pages.show(await capture());
    await inViewer(page, (viewer) => viewer.pause(), null);
    await page.keyboard.press('Home');
    await page.getByText('1 lost').waitFor();
    await expect.poll(() => page.locator('[data-score]').textContent()).toBe('1 %');
    await page.keyboard.press('m');
    await expect.poll(() => page.locator('[data-score]').textContent()).toBe('3 % lost');
    const slider = page.getByRole('slider', { name: 'Frame' });
    expect(await slider.getAttribute('aria-valuetext')).toBe('frame 2 · score 3 % · lost');
    const [mark, thumb] = await Promise.all(['.lost', '.thumb'].map((part) => slider.locator(part).boundingBox()));
    expect(Math.abs(mark!.x + mark!.width / 2 - thumb!.x - thumb!.width / 2)).toBeLessThan(2);
    expect(await seriousFindings(page)).toEqual([]);

    await dropOnViewer(page, { 'walk.json': Buffer.from('{"frames": []}') });
    await page.getByText('The report has 0 frames and the capture').waitFor();
    await dropOnViewer(page, { 'notes.json': Buffer.from('nothing') });
    await page.getByText('notes.json is not a report').waitFor();
    expect(pages.errors).toEqual([]);
  });

  it('paints how far each frame is from the surface that is dropped, on a phone too', async () => {
    const page = await pages.show(await capture());
    await page.keyboard.press('Home');
    await page.keyboard.press('h');
    await page.keyboard.press('h');
    await page.getByText('Drop the surfaces that it was recovered from here').waitFor();
    await dropOnViewer(page, await surfaces());
    await page.getByText('Distance from the surface').waitFor();
    for (const frame of [0, 2]) {
      await inViewer(page, (viewer, wanted) => void (viewer.pause(), (viewer.frame = wanted)), frame);
      // To a twentieth of what one frame is further off than the one before.
      const steps = (distance: number) => Math.round((20 * distance) / STEP) / 20;
      const found = async () => {
        const now = await measured(page);
        return now && [now.frame, steps(now.l2), steps(now.largest)];
      };
      await expect.poll(found).toEqual([frame, frame + 1, frame + 1]);
    }
    await page.setViewportSize(PHONE);
    expect(await seriousFindings(page)).toEqual([]);
    const canvas = page.getByRole('img', { name: '3D view' });
    const both = await canvas.screenshot();
    await page.getByRole('button', { name: 'Observed' }).click();
    await expect.poll(async () => both.equals(await canvas.screenshot())).toBe(false);
    await inViewer(page, (viewer) => viewer.play(), null);
    await expect.poll(() => measured(page).then((found) => found?.frame)).toBe(1);
    await page.getByRole('button', { name: 'Close the original' }).click();
    await expect.poll(() => page.getByRole('button', { name: 'Observed' }).count()).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  it('says which surfaces are missing, and which cannot be read', async () => {
    const page = await pages.show(await capture());
    const [[, first]] = Object.entries(await surfaces());
    await dropOnViewer(page, { 'other.ply': Buffer.from('ply\nelement vertex 5\n') });
    await page.getByText(/^There are 1 surface and|^There is/).waitFor();
    await dropOnViewer(page, { 'scan_0.obj': first, 'scan_1.obj': Buffer.from('v 0 0\n') });
    await page.getByText('scan_1.obj: point 0 is').waitFor();
    expect(pages.errors).toEqual([]);
  });
});

describe.skipIf(missing)('a recovery in the service', { timeout: 240_000 }, () => {
  let site: Site;
  const sphere = new SphereCapture(2);

  beforeAll(async () => {
    site = await Site.start();
  }, 120_000);

  afterAll(() => site.close());

  it('is waited for, found in the list, and played with its scores', async () => {
    const call = async (path: string, init?: RequestInit) => {
      const response = await fetch(`${site.service.origin}/v1/recoveries${path}`, init);
      if (!response.ok) throw new Error(`${response.status} ${await response.text()}`);
      return response.json() as Promise<{ id: string; state: string }>;
    };
    const body = new FormData();
    body.append('template', new Blob([sphere.rest]), 'rest.obj');
    body.append('cage', new Blob([sphere.cage]), 'cage.obj');
    body.append('options', JSON.stringify({ name: 'scanned dance', points: 300 }));
    const { id } = await call('', { method: 'POST', body });
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/recovery/${id}`);
    await page.getByText('Recovered 0 of 0 frames').waitFor();
    const frames = new FormData();
    for (let k = 0; k < 3; k++) frames.append('frame', new Blob([sphere.frameObj(k)]), `scan_${k}.obj`);
    await call(`/${id}/frames?first=0`, { method: 'POST', body: frames });
    const headers = { 'Content-Type': 'application/json' };
    await call(`/${id}/complete`, { method: 'POST', headers, body: '{"frames": 3}' });
    while ((await call(`/${id}`)).state !== 'completed') await page.waitForTimeout(500);
    await whenShown(page);
    await expect.poll(() => page.locator('[data-score]').textContent()).toMatch(/ %$/);
    expect(await page.getByRole('heading', { name: 'scanned dance' }).count()).toBe(1);

    await page.goto(`${site.page}#/`);
    await page.getByRole('link', { name: 'scanned dance' }).waitFor();
    await page.getByText('3 frames').waitFor();
    await page.setViewportSize(PHONE);
    expect(await seriousFindings(page)).toEqual([]);
    await page.getByRole('link', { name: 'scanned dance' }).click();
    await whenShown(page);
    expect(errors).toEqual([]);
    await close();
  });
});

/** A container with the report of a recovery whose last frame is lost. */
async function capture(): Promise<Record<string, Uint8Array>> {
  const frames = ['followed', 'wider_search', 'lost'].map((outcome, k) => {
    return { number: k, file: `scans/scan_${k}.obj`, outcome, score: 0.01 * (k + 1) };
  });
  const report = Buffer.from(JSON.stringify({ frames, lost: [2] }));
  return { 'walk.cager': await goldenBytes('definition3-mvc.cager'), 'walk.json': report };
}

/** A cloud for each frame: its points moved along x, and one that is far away. */
async function surfaces(): Promise<Record<string, Uint8Array>> {
  const { shape, values } = parseNpy(await goldenBytes('definition3-mvc.npy'));
  const diagonal = diagonalOf((await openBytes(await goldenBytes('definition3-mvc.cager'))).static.rest);
  const files = Array.from({ length: shape[0] }, (_, frame) => {
    const lines = ['v 1000 0 0'];
    for (let k = 3 * shape[1] * frame; k < 3 * shape[1] * (frame + 1); k += 3)
      lines.push(`v ${values[k] + STEP * (frame + 1) * diagonal} ${values[k + 1]} ${values[k + 2]}`);
    return [`scan_${frame}.obj`, Buffer.from(`${lines.join('\n')}\n`)] as const;
  });
  return Object.fromEntries(files);
}

/** What the viewer shows of the frame's distances. */
async function measured(page: Page) {
  return inViewer(
    page,
    (viewer) => {
      const found = viewer.player!.heatMap.measured;
      return found && { frame: found.frame, l2: found.l2, largest: found.largest };
    },
    null,
  );
}
