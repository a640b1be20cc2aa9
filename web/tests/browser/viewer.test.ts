import { readFile } from 'node:fs/promises';
import { ALL_FORMATS, BufferSource, Input } from 'mediabunny';
import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { diagonalOf } from '../../src/coordinates/topology';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { dropOnViewer, FilePages, goldenBytes, inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

describe.skipIf(chromium === undefined)('the viewer', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();
  const dropped = async (name: string, fragment?: string) =>
    pages.open({ [`${name}.cager`]: await goldenBytes(`${name}.cager`) }, fragment);
  const opened = async (name: string, fragment?: string) => {
    const page = await dropped(name, fragment);
    await whenShown(page);
    return page;
  };

  it.each(['definition3-mvc', 'coded-mvc'])(
    '%s is dropped on the page, plays, and decodes to the positions that the program decodes',
    async (name) => {
      const page = await opened(name);
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
      expect(pages.errors).toEqual([]);
    },
  );

  it('keeps frame, camera and heat map in the address, and returns to them', async () => {
    const page = await opened('definition3-mvc');
    // The first step stops the playing, which would go on from the end.
    for (const key of ['ArrowLeft', 'End', 'ArrowLeft', 'd', 'h']) await page.keyboard.press(key);
    await page.waitForFunction(() => /frame=\d+&camera=.*&heat=motion/.test(location.hash));
    // In the unit of the files as well.
    await page.getByText(/^≥ [\d.]+ % of the diagonal \([\d.e-]+\)$/).waitFor();
    const fragment = await page.evaluate(() => location.hash);
    await pages.close();
    const again = await opened('definition3-mvc', fragment);
    // As long as it takes until the address follows the view.
    await again.waitForTimeout(600);
    await again.getByText('Motion between frames').waitFor();
    expect(await again.evaluate(() => location.hash)).toBe(fragment);
  });

  it('plays the part between in and out back and forth, looks without perspective, and returns to a saved view', async () => {
    const page = await opened('definition3-mvc');
    for (const key of ['ArrowLeft', 'Home', 'ArrowRight', '[', 'ArrowRight', ']', 'l']) await page.keyboard.press(key);
    const { range, repeat } = await inViewer(page, ({ player }) => player!.transport, null);
    expect([range, repeat]).toEqual([[1, 2], 'ping-pong']);
    await page.keyboard.press('v');
    await page.getByRole('button', { name: 'Top' }).click();
    await page.waitForFunction(() => /camera=0,89[^&]*,-/.test(decodeURIComponent(location.hash)));
    await page.getByRole('button', { name: 'Save this view' }).click();
    await page.keyboard.press('0');
    await page.waitForFunction(() => !location.hash.includes('camera='));
    await page.getByRole('button', { name: '1. Frame 2, orthographic' }).click();
    await page.waitForFunction(() => /camera=0,89[^&]*,-/.test(decodeURIComponent(location.hash)));
    expect(await seriousFindings(page)).toEqual([]);
    expect(pages.errors).toEqual([]);
  });

  it('saves a picture and a turntable video', { timeout: 150_000 }, async () => {
    const page = await opened('definition3-mvc');
    await page.setViewportSize({ width: 480, height: 320 });
    const download = async (key: string) => {
      const [saved] = await Promise.all([
        page.waitForEvent('download', { timeout: 120_000 }),
        page.keyboard.press(key),
      ]);
      return { name: saved.suggestedFilename(), content: await readFile(await saved.path()) };
    };
    const picture = await download('p');
    expect(picture.name).toMatch(/^definition3-mvc-\d+\.png$/);
    expect(picture.content.subarray(1, 4).toString()).toBe('PNG');
    expect(picture.content.length).toBeGreaterThan(10_000);
    const before = await inViewer(page, ({ player }) => player!.controls.destination, null);
    const video = await download('t');
    expect(video.name).toMatch(/^definition3-mvc\.(webm|mp4)$/);
    // Each of its pictures, however slowly they are drawn here.
    const track = await new Input({
      source: new BufferSource(video.content),
      formats: ALL_FORMATS,
    }).getPrimaryVideoTrack();
    expect(await track!.computePacketStats()).toMatchObject({ packetCount: 240 });
    expect(await track!.computeDuration()).toBeCloseTo(8, 2);
    expect(await inViewer(page, ({ player }) => player!.controls.destination, null)).toEqual(before);
    expect(pages.errors).toEqual([]);
  });

  it('says where no video can be recorded', async () => {
    const page = await opened('definition3-mvc');
    await page.evaluate(() => Reflect.deleteProperty(globalThis, 'VideoEncoder'));
    await page.keyboard.press('t');
    await page
      .getByRole('alert')
      .getByText(/cannot record videos here/)
      .waitFor();
    expect(pages.errors).toEqual([]);
  });

  it('exports the frame as a mesh and the file as it is', async () => {
    const page = await opened('coded-mvc');
    await page.keyboard.press('Home');
    await page.keyboard.press('/');
    const panel = page.getByRole('complementary', { name: 'Export' });
    const saved = async (name: string) => {
      const [file] = await Promise.all([
        page.waitForEvent('download'),
        panel.getByRole('button', { name, exact: true }).click(),
      ]);
      return { name: file.suggestedFilename(), content: await readFile(await file.path()) };
    };
    const mesh = await saved('Points of this frame .obj');
    expect(mesh.name).toMatch(/^coded-mvc-\d\.obj$/);
    expect(mesh.content.toString().match(/^v /gm)).toHaveLength(120);
    const file = await saved('CageR .cager');
    expect(file.name).toBe('coded-mvc.cager');
    expect(new Uint8Array(file.content)).toEqual(await goldenBytes('coded-mvc.cager'));
    expect(await seriousFindings(page)).toEqual([]);
    expect(pages.errors).toEqual([]);
  });

  it('is named after what it shows, and turns it by a button that the address follows', async () => {
    const page = await opened('definition3-mvc');
    await expect.poll(() => page.title()).toBe('definition3-mvc.cager – CageR');
    await page.keyboard.press('ArrowLeft');
    await page.getByRole('button', { name: 'Up: Y' }).click();
    await page.getByRole('button', { name: 'Up: Z' }).waitFor();
    await page.waitForFunction(() => location.hash.includes('up=z'));
    await page.keyboard.press('z');
    await page.waitForFunction(() => !location.hash.includes('up='));
    expect(pages.errors).toEqual([]);
  });

  it('has an axis that points up for each of two captures, both in the address', async () => {
    const [first, second] = [await goldenBytes('definition3-mvc.cager'), await goldenBytes('coded-mvc.cager')];
    const page = await pages.show({ 'first.cager': first, 'second.cager': second });
    await page.keyboard.press('ArrowLeft');
    const beside = page.getByRole('region', { name: 'Second capture' });
    await beside.getByRole('button', { name: 'Up: Y' }).click();
    await beside.getByRole('button', { name: 'Up: Z' }).waitFor();
    await page.waitForFunction(() => location.hash.includes('besideUp=z') && !location.hash.includes('up='));
    const axes = () => inViewer(page, (viewer) => [viewer.up, viewer.pair.player!.up], null);
    expect(await axes()).toEqual(['y', 'z']);
    await page.keyboard.press('z');
    expect(await axes()).toEqual(['z', 'z']);
    expect(await seriousFindings(page)).toEqual([]);
    expect(pages.errors).toEqual([]);
  });

  it('offers to upload frames that are dropped and are no capture yet', async () => {
    const page = await pages.open();
    await dropOnViewer(page, { 'walk.npy': await goldenBytes('definition3-mvc.npy') });
    await page.getByText('walk.npy is not encoded yet').waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await page.getByRole('button', { name: 'Upload' }).click();
    await page.getByRole('heading', { name: 'Upload a capture' }).waitFor();
    await page.getByText('walk.npy', { exact: true }).waitFor();
    expect(await page.title()).toBe('Upload – CageR');
  });

  it('says that a part of it did not come, and offers to load it anew', async () => {
    const page = await pages.open();
    await page.route(/residualWorker/, (route) => route.abort());
    await dropOnViewer(page, { 'walk.cager': await goldenBytes('coded-mvc.cager') });
    await page.getByRole('alert').getByText('Part of the page could not be loaded. Reload the page.').waitFor();
    await page.unroute(/residualWorker/);
    await page.getByRole('button', { name: 'Reload' }).click();
    await page.getByRole('heading', { name: 'Drop a capture here' }).waitFor();
  });

  it('says what to do where a capture needs a service, and still shows its cage', async () => {
    const page = await dropped('definition3-harmonic');
    await page
      .getByRole('alert')
      .getByText(/service/)
      .waitFor();
    await expect
      .poll(() => page.getByRole('button', { name: 'Cage', exact: true }).getAttribute('aria-pressed'))
      .toBe('true');
    expect(pages.errors).toEqual([]);
  });

  it('says what is wrong with a file that is no capture, and takes the next one', async () => {
    const page = await pages.open();
    expect(await seriousFindings(page)).toEqual([]);
    await dropOnViewer(page, {
      'broken.cager': Buffer.from('this is no capture at all, but it is long enough to look like one'),
    });
    await page.getByRole('alert').waitFor();
    await dropOnViewer(page, { 'good.cager': await goldenBytes('definition3-mvc.cager') });
    await whenShown(page);
    expect(pages.errors).toEqual([]);
  });

  it('says what to do where there is no WebGL', async () => {
    const page = await pages.open();
    await page.evaluate(() => {
      HTMLCanvasElement.prototype.getContext = () => null;
      OffscreenCanvas.prototype.getContext = () => null;
    });
    await dropOnViewer(page, { 'walk.cager': await goldenBytes('definition3-mvc.cager') });
    await page
      .getByRole('alert')
      .getByText(/WebGL 2/)
      .waitFor();
  });

  it('draws on after the graphics processor was taken away', async () => {
    const page = await opened('definition3-mvc');
    const before = await readPositions(page, 1);
    await inViewer(
      page,
      async (viewer) => {
        const canvas = viewer.renderRoot.querySelector('canvas')!;
        const extension = canvas.getContext('webgl2')!.getExtension('WEBGL_lose_context')!;
        const restored = new Promise((resolve) => canvas.addEventListener('webglcontextrestored', resolve));
        extension.loseContext();
        await new Promise((resolve) => setTimeout(resolve, 200));
        extension.restoreContext();
        await restored;
      },
      null,
    );
    expect(await readPositions(page, 1)).toEqual(before);
  });

  it('shows every layer, the heat map, figures and shortcuts by keyboard alone', async () => {
    const page = await opened('coded-mvc');
    for (const [key, name] of [
      ['2', 'Wireframe'],
      ['3', 'Points'],
      ['4', 'Cage'],
      ['i', 'Statistics'],
    ]) {
      await page.keyboard.press(key);
      await expect
        .poll(() => page.getByRole('button', { name, exact: true }).getAttribute('aria-pressed'))
        .toBe('true');
    }
    await page.keyboard.press('h');
    await page.getByText('Motion between frames').waitFor();
    await page.keyboard.press('?');
    await page.getByRole('dialog', { name: 'CageR help' }).getByText('Diagonal', { exact: true }).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await page.keyboard.press('Escape');
    expect(await seriousFindings(page)).toEqual([]);
    const frame = () => inViewer(page, (viewer) => viewer.frame, null);
    // A step stops the playing, which would go on between two keys.
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('Home');
    await page.keyboard.press('ArrowRight');
    await expect.poll(frame).toBe(1);
    expect(pages.errors).toEqual([]);
  });
});

/** Waits until another frame is shown. */
async function playsOn(page: Page) {
  const frame = () => inViewer(page, (viewer) => viewer.frame, null);
  const first = await frame();
  await expect.poll(frame, { timeout: 20_000 }).not.toBe(first);
}

/** Positions that the viewer decodes for the picture. */
function readPositions(page: Page, frame: number): Promise<number[]> {
  return inViewer(page, async (viewer, wanted) => [...(await viewer.readPositions(wanted))], frame);
}
