import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { openPage, slow } from './harness/browser';
import { NoisyCapture } from './harness/noisyCapture';
import { missing } from './harness/programs';
import { Site } from './harness/site';
import { inViewer, whenShown } from './harness/viewing';

/** More frames than are read with the model, at a rate that needs more than the connection has. */
const [FRAMES, FRAME_RATE, BYTES_PER_SECOND] = [600, 240, 25_000];

describe.skipIf(missing)('a slow connection', { timeout: 90_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start();
  }, 120_000);

  afterAll(() => site.close());

  test('plays cages alone and adds their residual when they stand', async () => {
    const id = await site
      .client()
      .encode(new NoisyCapture(), { name: 'thin', max_error: 3e-4, frame_rate: FRAME_RATE }, FRAMES);
    // The page of files has all parts of the viewer; only then does the connection become slow.
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/file`);
    await page.locator('cager-viewer').waitFor({ state: 'attached' });
    await slow(page, { downloadThroughput: BYTES_PER_SECOND });
    await page.evaluate((session) => (location.hash = `#/session/${session}`), id);
    await whenShown(page);
    await page.keyboard.press('i');
    await page.getByText('the cages play alone').waitFor({ timeout: 30_000 });
    const shown = () =>
      inViewer(
        page,
        async ({ player }, last) => {
          const { residuals } = player!.capture;
          return { leftOut: residuals!.leftOut, hasResidual: (await player!.capture.block(last)).residual !== null };
        },
        FRAMES - 1,
      );
    expect(await shown()).toEqual({ leftOut: true, hasResidual: false });
    expect(await page.locator('cager-viewer [data-linf]').textContent()).toBe('–');

    await slow(page, {});
    await page.keyboard.press('End');
    await page.keyboard.press('k');
    await expect.poll(shown).toEqual({ leftOut: false, hasResidual: true });
    await expect.poll(() => page.locator('cager-viewer [data-linf]').textContent()).toMatch(/ %$/);
    expect(errors).toEqual([]);
    await close();
  });
});
