import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { openBytes } from '../support/containers';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { FilePages, goldenBytes, inViewer } from './harness/viewing';

describe.skipIf(chromium === undefined)('poses of a capture', { timeout: 120_000 }, () => {
  const pages = FilePages.ofSuite();

  it('are blended by a slider and by a pad, in shapes that the service finds', async () => {
    const bytes = await goldenBytes('definition3-mvc.cager');
    const page = await pages.show({ 'walk.cager': bytes });
    const cage = (await openBytes(bytes)).static.cage.positions;
    const asked = await answerShapes(page, cage);
    await inViewer(page, (viewer) => viewer.pause(), null);
    await page.keyboard.press('Home');
    await page.keyboard.press('n');
    const add = page.getByRole('button', { name: 'Add this frame' });
    await add.click();
    expect(await page.locator('[data-linf]').textContent()).toMatch(/%$/);
    await page.keyboard.press('ArrowRight');
    await add.click();
    await expect.poll(() => asked.weights.at(-1)).toBe('0.5,0.5');
    expect(asked.frames).toEqual([[0, 1]]);
    // The service of this test answers with the cage at rest, as large as the first weight.
    await expect.poll(() => shown(page)).toBeCloseTo(0.5, 4);
    // What was measured of a frame is not what is shown.
    expect(await page.locator('[data-linf]').textContent()).toBe('–');
    const slider = page.getByRole('slider', { name: 'Blend from the first pose to the second' });
    await slider.press('ArrowRight');
    await expect.poll(() => shown(page)).toBeCloseTo(0.49, 4);
    expect(await seriousFindings(page)).toEqual([]);

    await page.keyboard.press('End');
    await add.click();
    const pad = page.getByRole('application', { name: /^Pose pad/ });
    const { x, y, width, height } = (await pad.boundingBox())!;
    // The first corner, and half way from there to the middle.
    await page.mouse.click(x + width / 2, y + 0.1 * height);
    await expect.poll(() => shown(page)).toBeCloseTo(1, 2);
    await page.mouse.click(x + width / 2, y + 0.3 * height);
    await expect.poll(() => shown(page)).toBeCloseTo(2 / 3, 2);
    expect(asked.frames).toEqual([
      [0, 1],
      [0, 1, 2],
    ]);
    await page.setViewportSize({ width: 390, height: 844 });
    expect(await seriousFindings(page)).toEqual([]);

    asked.isForgotten = true;
    await pad.press('ArrowLeft');
    await expect.poll(() => asked.frames.length).toBe(3);
    await page.getByRole('button', { name: 'Remove frame 0' }).click();
    await page.getByRole('button', { name: 'Remove frame 1' }).click();
    await page.getByText('Go to a frame and add it').waitFor();
    expect(await inViewer(page, (viewer) => viewer.player!.playback.shape, null)).toBeNull();
    expect(pages.errors.filter((error) => !error.includes('404'))).toEqual([]);
  });
});

/** Answers in place of a service, and keeps what it was asked. */
async function answerShapes(page: Page, cage: Float64Array) {
  const asked = { frames: [] as number[][], weights: [] as string[], isForgotten: false };
  await page.route('**/v1/shapespaces**', async (route) => {
    const request = route.request();
    if (request.method() === 'POST') {
      asked.isForgotten = false;
      const options = /\{"frames":(\[[\d,]+\])\}/.exec(request.postDataBuffer()!.toString('latin1'))!;
      asked.frames.push(JSON.parse(options[1]) as number[]);
      await route.fulfill({ status: 201, json: { id: `space-${asked.frames.length}` } });
      return;
    }
    await route.fulfill({ status: 204 });
  });
  await page.route('**/v1/shapespaces/*/pose?**', async (route) => {
    if (asked.isForgotten) {
      const json = { type: 'urn:cager:problem:not-found', detail: 'gone' };
      await route.fulfill({ status: 404, contentType: 'application/problem+json', json });
      return;
    }
    const weights = new URL(route.request().url()).searchParams.get('weights')!;
    asked.weights.push(weights);
    const scale = Number(weights.split(',')[0]);
    const body = Buffer.from(Float32Array.from(cage, (x) => scale * x).buffer);
    await route.fulfill({ contentType: 'application/octet-stream', body });
  });
  return asked;
}

/** How large the cage is that is shown, as part of that at rest. */
function shown(page: Page): Promise<number> {
  return inViewer(
    page,
    ({ player }) => {
      const size = (values: ArrayLike<number>) => {
        const along = Array.from({ length: values.length / 3 }, (_, k) => values[3 * k]);
        return Math.max(...along) - Math.min(...along);
      };
      const { stage, capture } = player!;
      return (size(stage.cageVertices) * stage.decoder.diagonal) / size(capture.static.cage.positions);
    },
    null,
  );
}
