import { readFile } from 'node:fs/promises';
import type { Browser, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import { diagonalOf } from '../../src/coordinates/topology';
import type { CagerViewer } from '../../src/viewer/cagerViewer';
import type { ViewerPage } from '../../src/viewer/viewerPage';
import { seriousFindings } from './harness/axe';
import { launch, openPage, type Watched } from './harness/browser';
import { PageServer } from './harness/pageServer';
import { chromium } from './harness/programs';
import { parseNpy } from './npy';

const golden = new URL('../../../tests/golden/', import.meta.url);

describe.skipIf(chromium === undefined)('the viewer', { timeout: 90_000 }, () => {
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

  /** Opens the page of files and drops a golden capture on it. */
  async function opened(name: string, fragment = '#/file'): Promise<Page> {
    watched = await openPage(browser, `${server.base}${fragment}`);
    await drop(watched.page, `${name}.cager`, await goldenBytes(`${name}.cager`));
    return watched.page;
  }

  it.each(['definition3-mvc', 'definition3-green', 'definition3-green-free', 'coded-mvc', 'coded-green'])(
    '%s is dropped on the page, plays, and decodes to the positions that the program decodes',
    async (name) => {
      const page = await opened(name);
      await ready(page);
      await playsOn(page);
      const expected = parseNpy(await goldenBytes(`${name}.npy`));
      const [frames, points] = expected.shape;
      const diagonal = diagonalOf(expected.values.subarray(0, 3 * points));
      for (const frame of [0, Math.floor(frames / 2), frames - 1]) {
        const positions = await readPositions(page, frame);
        expect(positions).toHaveLength(3 * points);
        let worst = 0;
        for (let k = 0; k < positions.length; k++) {
          worst = Math.max(worst, Math.abs(positions[k] - expected.values[3 * points * frame + k]));
        }
        expect(worst / diagonal, `frame ${frame}`).toBeLessThan(1e-4);
      }
      expect(watched?.errors).toEqual([]);
    },
  );

  it('keeps frame and camera in the address, and returns to them', async () => {
    const page = await opened('definition3-mvc');
    await ready(page);
    await page.keyboard.press('End');
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('d');
    await page.waitForFunction(() => /frame=\d+&camera=/.test(location.hash));
    const fragment = await page.evaluate(() => location.hash);
    await watched!.close();
    const again = await opened('definition3-mvc', fragment);
    await ready(again);
    // As long as it takes until the address follows the view.
    await again.waitForTimeout(600);
    expect(await again.evaluate(() => location.hash)).toBe(fragment);
  });

  it('saves a picture and a turntable video', async () => {
    const page = await opened('definition3-mvc');
    await ready(page);
    const download = async (key: string) => {
      const [saved] = await Promise.all([page.waitForEvent('download', { timeout: 60_000 }), page.keyboard.press(key)]);
      return { name: saved.suggestedFilename(), content: await readFile(await saved.path()) };
    };
    const picture = await download('p');
    expect(picture.name).toMatch(/^definition3-mvc-\d+\.png$/);
    expect(picture.content.subarray(1, 4).toString()).toBe('PNG');
    expect(picture.content.length).toBeGreaterThan(10_000);
    const video = await download('t');
    expect(video.name).toMatch(/^definition3-mvc\.(webm|mp4)$/);
    expect(video.content.length).toBeGreaterThan(10_000);
    expect(watched?.errors).toEqual([]);
  });

  it('says what to do where a capture needs a service, and still shows its cage', async () => {
    const page = await opened('definition3-harmonic');
    await page
      .getByRole('alert')
      .getByText(/service/)
      .waitFor();
    await expect
      .poll(() => page.getByRole('button', { name: 'Cage', exact: true }).getAttribute('aria-pressed'))
      .toBe('true');
    expect(watched?.errors).toEqual([]);
  });

  it('says what is wrong with a file that is no capture, and takes the next one', async () => {
    watched = await openPage(browser, `${server.base}#/file`);
    const { page, errors } = watched;
    expect(await seriousFindings(page)).toEqual([]);
    await drop(page, 'broken.cager', Buffer.from('this is no capture at all, but it is long enough to look like one'));
    await page.getByRole('alert').waitFor();
    await drop(page, 'good.cager', await goldenBytes('definition3-mvc.cager'));
    await ready(page);
    expect(errors).toEqual([]);
  });

  it('says what to do where there is no WebGL', async () => {
    watched = await openPage(browser, `${server.base}#/file`);
    await watched.page.evaluate(() => {
      HTMLCanvasElement.prototype.getContext = () => null;
      OffscreenCanvas.prototype.getContext = () => null;
    });
    await drop(watched.page, 'walk.cager', await goldenBytes('definition3-mvc.cager'));
    await watched.page
      .getByRole('alert')
      .getByText(/WebGL 2/)
      .waitFor();
  });

  it('draws on after the graphics processor was taken away', async () => {
    const page = await opened('definition3-mvc');
    await ready(page);
    const before = await readPositions(page, 1);
    await withViewer(page, async (viewer) => {
      const canvas = viewer.renderRoot.querySelector('canvas')!;
      const extension = canvas.getContext('webgl2')!.getExtension('WEBGL_lose_context')!;
      const restored = new Promise((resolve) => canvas.addEventListener('webglcontextrestored', resolve));
      extension.loseContext();
      await new Promise((resolve) => setTimeout(resolve, 200));
      extension.restoreContext();
      await restored;
    });
    expect(await readPositions(page, 1)).toEqual(before);
  });

  it('shows every layer, the heat map, figures and shortcuts by keyboard alone', async () => {
    const page = await opened('coded-mvc');
    await ready(page);
    for (const [key, name] of [
      ['2', 'Wireframe'],
      ['3', 'Points'],
      ['4', 'Cage'],
      ['i', 'Figures'],
    ]) {
      await page.keyboard.press(key);
      await expect
        .poll(() => page.getByRole('button', { name, exact: true }).getAttribute('aria-pressed'))
        .toBe('true');
    }
    await page.keyboard.press('h');
    await page.getByText('Movement from frame to frame').waitFor();
    await page.keyboard.press('?');
    await page.getByRole('dialog', { name: 'Keyboard shortcuts' }).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await page.keyboard.press('Escape');
    expect(await seriousFindings(page)).toEqual([]);
    const frame = () => withViewer(page, (viewer) => Promise.resolve(viewer.frame));
    // A step stops the playing, which would go on between two keys.
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('Home');
    await page.keyboard.press('ArrowRight');
    await expect.poll(frame).toBe(1);
    expect(watched?.errors).toEqual([]);
  });
});

async function goldenBytes(name: string): Promise<Uint8Array> {
  return readFile(new URL(name, golden));
}

async function drop(page: Page, name: string, content: Uint8Array) {
  await page.locator('cager-viewer').waitFor({ state: 'attached' });
  await page.evaluate(
    ([fileName, base64]) => {
      const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([bytes], fileName));
      const viewer = document.querySelector<ViewerPage>('cager-viewer-page')!.renderRoot.querySelector('cager-viewer')!;
      viewer.dispatchEvent(new DragEvent('drop', { dataTransfer, bubbles: true, composed: true, cancelable: true }));
    },
    [name, Buffer.from(content).toString('base64')],
  );
}

/** Runs something in the page with its viewer; `of` must not refer to anything outside. */
async function withViewer<T>(page: Page, of: (viewer: CagerViewer) => Promise<T>): Promise<T> {
  return page.evaluate(
    `(${of.toString()})(document.querySelector('cager-viewer-page').shadowRoot.querySelector('cager-viewer'))`,
  );
}

/** Waits until the model can be seen. */
async function ready(page: Page) {
  await page.waitForFunction(() => {
    const viewer = document.querySelector<ViewerPage>('cager-viewer-page')?.renderRoot.querySelector('cager-viewer');
    return viewer?.player?.stage.decoder.ready === true && viewer.player.progress === null;
  });
}

/** Waits until another frame is shown. */
async function playsOn(page: Page) {
  const frame = () => withViewer(page, (viewer) => Promise.resolve(viewer.frame));
  const first = await frame();
  await expect.poll(frame, { timeout: 20_000 }).not.toBe(first);
}

async function readPositions(page: Page, frame: number): Promise<number[]> {
  return page.evaluate(
    `document.querySelector('cager-viewer-page').shadowRoot.querySelector('cager-viewer').readPositions(${frame}).then((positions) => [...positions])`,
  );
}
