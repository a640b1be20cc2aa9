import { readFile } from 'node:fs/promises';
import type { Browser } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, test } from 'vitest';
import type { CagerViewer } from '../../src/viewer/cagerViewer';
import { leave, openPage, sharedBrowser, type Watched } from './harness/browser';
import { PageServer } from './harness/pageServer';
import { chromium } from './harness/programs';
import { dropOnViewer, inViewer, whenShown } from './harness/viewing';

const golden = new URL('../../../tests/golden/', import.meta.url);

describe.skipIf(chromium === undefined)('captures that follow one another', { timeout: 90_000 }, () => {
  let server: PageServer;
  let browser: Browser;
  let watched: Watched;
  let capture: Uint8Array;

  beforeAll(async () => {
    server = await PageServer.start(() => 'http://127.0.0.1:1');
    browser = await sharedBrowser();
    capture = await readFile(new URL('definition3-mvc.cager', golden));
  }, 120_000);

  afterAll(async () => {
    await leave(browser);
    server.close();
  });

  afterEach(() => watched.close());

  /** The page of files, with a capture or without. */
  async function opened(files: Readonly<Record<string, Uint8Array>>) {
    watched = await openPage(browser, `${server.base}#/file`);
    if (Object.keys(files).length === 0) await watched.page.locator('cager-viewer').waitFor({ state: 'attached' });
    else {
      await dropOnViewer(watched.page, files);
      await whenShown(watched.page);
    }
    return watched.page;
  }

  test('a_file_that_is_no_capture_leaves_the_one_that_is_shown', async () => {
    const page = await opened({ 'first.cager': capture });
    for (const name of ['holiday.png', 'holiday.cager']) {
      await dropOnViewer(page, { [name]: Buffer.from('a picture of a beach') });
      await page.getByRole('alert').waitFor();
      expect(await inViewer(page, (viewer) => viewer.heading, null)).toBe('first.cager');
      await page.getByRole('button', { name: 'Dismiss' }).click();
    }
    await dropOnViewer(page, { 'second.cager': capture });
    await page.getByRole('button', { name: 'Replace current' }).click();
    await page.getByRole('img', { name: /^second\.cager: 3D view/ }).waitFor();
  });

  test('a_link_that_differs_in_its_view_moves_what_is_shown_and_going_back_returns', async () => {
    const page = await opened({ 'walk.cager': capture });
    const frame = () => inViewer(page, (viewer) => viewer.frame, null);
    await page.keyboard.press('Home');
    await inViewer(page, (viewer) => viewer.pause(), null);
    for (const wanted of [2, 1]) {
      await page.evaluate((to) => (location.hash = `#/file?frame=${to}&camera=1,0.5,3,0,0,0`), wanted);
      await expect.poll(frame).toBe(wanted);
    }
    await page.goBack();
    await expect.poll(frame).toBe(2);
    // As long as it takes until the address follows the view.
    await page.waitForTimeout(600);
    expect(await page.evaluate(() => location.hash)).toMatch(/^#\/file\?frame=2/);
  });

  test('an_element_that_is_moved_keeps_its_capture_and_one_put_back_opens_it_anew', async () => {
    const page = await opened({});
    await page.route('**/walk.cager', (route) => route.fulfill({ body: Buffer.from(capture) }));
    await page.evaluate(() => {
      const viewer = document.createElement('cager-viewer');
      viewer.id = 'embedded';
      viewer.src = 'walk.cager';
      document.body.replaceChildren(viewer);
    });
    const isShown = () =>
      page.evaluate(() => {
        const viewer = document.getElementById('embedded') as CagerViewer | null;
        return viewer?.player?.stage.decoder.ready === true;
      });
    await expect.poll(isShown, { timeout: 20_000 }).toBe(true);
    const keeps = await page.evaluate(async () => {
      const viewer = document.getElementById('embedded') as CagerViewer;
      const { player } = viewer;
      document.body.appendChild(document.createElement('div')).append(viewer);
      await viewer.updateComplete;
      const isSame = viewer.player === player;
      viewer.remove();
      await new Promise((resolve) => setTimeout(resolve, 50));
      const isLeft = viewer.player === null;
      document.body.append(viewer);
      return { isSame, isLeft };
    });
    expect(keeps).toEqual({ isSame: true, isLeft: true });
    await expect.poll(isShown, { timeout: 20_000 }).toBe(true);
    await page.evaluate(() => ((document.getElementById('embedded') as CagerViewer).src = null));
    await page.getByText('Drop a capture here').waitFor();
  });

  test('an_address_with_a_broken_escape_is_told_as_a_problem', async () => {
    const page = await opened({});
    const problem = await page.evaluate(() => {
      const viewer = document.createElement('cager-viewer');
      const told = new Promise((resolve) =>
        viewer.addEventListener('problem', (event) => resolve((event as CustomEvent).detail), { once: true }),
      );
      viewer.src = 'nothing/50%.cager';
      document.body.replaceChildren(viewer);
      return told;
    });
    expect(problem).toMatch(/\.$/);
  });

  test('a_small_picture_has_just_a_button_and_a_bar', async () => {
    const page = await opened({ 'walk.cager': capture });
    await page.setViewportSize({ width: 120, height: 90 });
    await expect.poll(() => page.locator('.tools').isVisible()).toBe(false);
    const [play, bar] = [page.getByRole('button', { name: /^(Play|Pause)$/ }), page.getByRole('slider')];
    for (const part of [play, bar]) {
      const box = (await part.boundingBox())!;
      expect(box.x).toBeGreaterThanOrEqual(0);
      expect(box.x + box.width).toBeLessThanOrEqual(120);
      expect(box.y + box.height).toBeLessThanOrEqual(90);
      expect(box.width).toBeGreaterThan(20);
    }
  });
});
