import { readFile } from 'node:fs/promises';
import type { Browser, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import { openBytes } from '../../src/container/testSupport';
import { diagonalOf } from '../../src/coordinates/topology';
import { npyHeader } from '../../src/editing/decodedFrames';
import { seriousFindings } from './harness/axe';
import { launch, openPage, type Watched } from './harness/browser';
import { PageServer } from './harness/pageServer';
import { chromium } from './harness/programs';
import { dropOnViewer, inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

const golden = new URL('../../../tests/golden/', import.meta.url);
/** The point that is moved in the original, and how far, as a fraction of the diagonal. */
const [MOVED, DISTANCE] = [5, 0.03];
/** What the picture's own rounding may add. */
const ROUNDING = 1e-4;

describe.skipIf(chromium === undefined)('a capture beside its original', { timeout: 90_000 }, () => {
  let server: PageServer;
  let browser: Browser;
  let watched: Watched | null = null;

  beforeAll(async () => {
    // Files play without any service.
    server = await PageServer.start(() => 'http://127.0.0.1:1');
    browser = await launch();
  }, 120_000);

  afterAll(async () => {
    await browser.close();
    server.close();
  });

  afterEach(async () => {
    await watched?.close();
    watched = null;
  });

  async function opened(): Promise<Page> {
    watched = await openPage(browser, `${server.base}#/file`);
    await dropOnViewer(watched.page, { 'walk.cager': await encoded() });
    await whenShown(watched.page);
    return watched.page;
  }

  it('says where the original could come from, and shows distances that are known', async () => {
    const page = await opened();
    await page.keyboard.press('Home');
    await page.keyboard.press('h');
    await page.keyboard.press('h');
    await page.getByText('neither the service nor the file keeps them').waitFor();
    expect(await seriousFindings(page)).toEqual([]);

    const { bytes, points } = await movedOriginal();
    await dropOnViewer(page, { 'walk.npy': bytes });
    await page.getByText('Distance from the original').waitFor();
    for (const frame of [0, 2]) {
      await inViewer(page, (viewer, wanted) => void (viewer.frame = wanted), frame);
      await expect.poll(async () => (await measured(page))?.frame).toBe(frame);
      const errors = (await measured(page))!;
      // The original has one point elsewhere in every frame, farther in later ones.
      const expected = DISTANCE * (1 + frame);
      expect(errors.worst).toBe(MOVED);
      expect(Math.abs(errors.largest - expected)).toBeLessThan(ROUNDING);
      expect(errors.values[MOVED]).toBe(Math.fround(errors.largest));
      expect(Math.max(...errors.values.filter((_, point) => point !== MOVED))).toBeLessThan(ROUNDING);
      expect(Math.abs(errors.l2 - expected / Math.sqrt(points))).toBeLessThan(ROUNDING);
    }
    await page.getByText(new RegExp(`^Point ${MOVED}: (8\\.99|9|9\\.01) % `)).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    expect(watched?.errors).toEqual([]);
  });

  it('shows original and decoded model with one camera, and the line between them moves by keyboard', async () => {
    const page = await opened();
    await dropOnViewer(page, { 'walk.npy': (await movedOriginal()).bytes });
    await page.getByText('Distance from the original').waitFor();
    await page.keyboard.press('o');
    await expect.poll(() => page.getByRole('button', { name: 'Both' }).getAttribute('aria-pressed')).toBe('true');
    const line = page.getByRole('slider', { name: 'Where the original ends' });
    await line.focus();
    await page.keyboard.press('ArrowLeft');
    await expect.poll(() => line.getAttribute('aria-valuenow')).toBe('48');
    expect(await seriousFindings(page)).toEqual([]);
    const canvas = page.getByRole('img', { name: 'the model, drawn' });
    const both = await canvas.screenshot();
    await page.getByRole('button', { name: 'Original', exact: true }).click();
    await page.waitForTimeout(500);
    expect(both.equals(await canvas.screenshot())).toBe(false);
    await page.getByRole('button', { name: 'Put the original away' }).click();
    await expect.poll(() => page.getByRole('button', { name: 'Both' }).count()).toBe(0);
    expect(watched?.errors).toEqual([]);
  });

  it('says why frames of something else are not taken, and plays on', async () => {
    const page = await opened();
    await dropOnViewer(page, { 'other.npy': Buffer.concat([npyHeader([1, 2, 3]), Buffer.alloc(24)]) });
    await page
      .getByRole('alert')
      .getByText(/other\.npy has 2 points in each frame and the capture/)
      .waitFor();
    await dropOnViewer(page, { 'notes.txt': Buffer.from('nothing') });
    await page
      .getByRole('alert')
      .getByText(/These are no frames/)
      .waitFor();
    expect(watched?.errors).toEqual([]);
  });
});

/** The errors that the viewer shows. */
async function measured(page: Page) {
  const errors = await inViewer(
    page,
    (viewer) => {
      const found = viewer.player!.heatMap.measured;
      return found && { ...found, values: [...found.values], places: null };
    },
    null,
  );
  return errors;
}

async function encoded(): Promise<Uint8Array> {
  // Copied: a Buffer of Node lies somewhere within a larger one.
  return Uint8Array.from(await readFile(new URL('definition3-mvc.cager', golden)));
}

/** What the program decodes, with one point moved along x: farther from frame to frame. */
async function movedOriginal(): Promise<{ bytes: Uint8Array; points: number }> {
  const decoded = parseNpy(await readFile(new URL('definition3-mvc.npy', golden)));
  const diagonal = diagonalOf((await openBytes(await encoded())).static.rest);
  const [frames, points] = decoded.shape;
  const moved = Float32Array.from(decoded.values);
  for (let frame = 0; frame < frames; frame++) moved[3 * (points * frame + MOVED)] += DISTANCE * (1 + frame) * diagonal;
  return { bytes: Buffer.concat([npyHeader(decoded.shape), Buffer.from(moved.buffer)]), points };
}
