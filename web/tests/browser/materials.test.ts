import type { Page } from 'playwright-core';
import { describe, expect, test } from 'vitest';
import { pngOf } from '../support/png';
import { surfaceBytes, withNames, withPictures } from '../support/surfaces';
import { seriousFindings } from './harness/axe';
import { PHONE } from './harness/browser';
import { chromium } from './harness/programs';
import { FilePages, goldenBytes, inViewer } from './harness/viewing';

/** Pixels that count as a quarter of the box's front. */
const MANY = 300;
const [RED, GREEN, BLUE, GREY, CLEAR] = [
  [255, 0, 0, 255],
  [0, 200, 0, 255],
  [0, 0, 255, 255],
  [128, 128, 128, 255],
  [255, 0, 0, 0],
];

/** A picture whose middle upper third lies on the front of the box: red above left, green above right, blue below. */
const painted = pngOf(48, 32, (x, y) => {
  if (x < 16 || x >= 32 || y >= 16) return GREY;
  return y >= 8 ? BLUE : x < 24 ? RED : GREEN;
});
const bytes = withPictures(surfaceBytes(), { 'painted.png': painted });

describe.skipIf(chromium === undefined)('what lies on faces', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();
  const opened = async (file = bytes, fragment = '#/file?frame=0', device = {}) => {
    const page = await pages.show({ 'box.cager': file }, fragment, device);
    await page.getByRole('button', { name: 'Materials', exact: true }).waitFor();
    return page;
  };
  /** Waits until there are so many red pixels: pictures come after the model. */
  const redIs = (page: Page, isThere: boolean) =>
    expect.poll(async () => (await colorsOf(page)).red.count > MANY).toBe(isThere);
  const panelOf = (page: Page) => page.getByRole('complementary', { name: 'Parts' });

  test('is_drawn_the_right_way_up_until_the_switch_turns_it_off', async () => {
    const page = await opened();
    await redIs(page, true);
    const { red, green, blue } = await colorsOf(page);
    expect(Math.min(green.count, blue.count)).toBeGreaterThan(MANY);
    expect(red.x).toBeLessThan(green.x);
    expect(Math.max(red.y, green.y)).toBeLessThan(blue.y);
    expect(await seriousFindings(page)).toEqual([]);

    await page.getByRole('button', { name: 'Materials', exact: true }).click();
    await redIs(page, false);
    await page.waitForFunction(() => location.hash.endsWith('show=mgkx'));
    await page.keyboard.press('*');
    await redIs(page, true);
    // The heat map has colours of its own.
    await page.keyboard.press('h');
    await page.getByText('Motion between frames').waitFor();
    await expect.poll(async () => (await colorsOf(page)).green.count).toBeLessThan(MANY / 3);
    expect(pages.errors).toEqual([]);
  });

  test('is_cut_out_where_a_picture_is_transparent', async () => {
    const holes = pngOf(48, 32, (x, y) => (x >= 16 && x < 32 && y < 16 ? CLEAR : GREY));
    const opaque = withPictures(surfaceBytes(), { 'painted.png': holes });
    const page = await opened(opaque);
    await redIs(page, true);
    await pages.close();
    const cut = withNames(opaque, (json) =>
      json.replace('"textures":[{', '"textures":[{"channel":"opacity","path":"painted.png"},{'),
    );
    await redIs(await opened(cut), false);
    expect(pages.errors).toEqual([]);
  });

  test('has_parts_that_are_hidden_shown_and_shown_alone', async () => {
    const page = await opened();
    await redIs(page, true);
    await page.getByRole('button', { name: 'Parts', exact: true }).click();
    const panel = panelOf(page);
    expect(await panel.getByRole('listitem').allInnerTexts()).toEqual(['box\n98', 'lid\n25']);
    expect(await seriousFindings(page)).toEqual([]);
    await panel.getByRole('checkbox', { name: 'box' }).press(' ');
    await redIs(page, false);
    expect(await panel.getByRole('checkbox', { name: 'box' }).isChecked()).toBe(false);
    await panel.getByText('box').click();
    await redIs(page, true);
    const all = (await colorsOf(page)).model;
    await panel.getByText('box').dblclick();
    await expect.poll(async () => panel.getByRole('checkbox', { name: 'lid' }).isChecked()).toBe(false);
    await redIs(page, true);
    // The same of the model without materials.
    await page.keyboard.press('*');
    await expect.poll(async () => (await colorsOf(page)).model).toBeLessThan(0.97 * all);
    await panel.getByRole('button', { name: 'Show all' }).click();
    await expect.poll(async () => (await colorsOf(page)).model).toBeGreaterThan(0.97 * all);
    expect(pages.errors).toEqual([]);
  });

  test('leaves_out_parts_in_frames_in_which_they_are_not_shown', async () => {
    const file = withNames(bytes, (json) => json.replace('"shown":null', '"shown":[{"start":1,"end":2}]'));
    const page = await opened(file);
    await page.keyboard.press('#');
    await panelOf(page).getByText('not in this frame').waitFor();
    await redIs(page, false);
    await page.keyboard.press('ArrowRight');
    await redIs(page, true);
    expect(await panelOf(page).getByText('not in this frame').count()).toBe(0);
    await page.keyboard.press('ArrowLeft');
    await redIs(page, false);
    expect(pages.errors).toEqual([]);
  });

  test('is_shown_without_pictures_that_no_browser_reads', async () => {
    const ktx = Uint8Array.of(0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0);
    const page = await opened(withPictures(surfaceBytes(), { 'painted.png': ktx }));
    await page.getByText('The texture painted.png is not shown').waitFor();
    expect((await colorsOf(page)).green.count).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  test('is_absent_where_a_capture_has_one_part_and_no_materials', async () => {
    const page = await pages.show({ 'plain.cager': await goldenBytes('definition3-mvc.cager') }, '#/file?frame=0');
    for (const name of ['Materials', 'Parts'])
      expect(await page.getByRole('button', { name, exact: true }).count()).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  test('has_parts_that_a_long_press_shows_alone_above_which_the_model_is_seen', async () => {
    const page = await opened(bytes, '#/file?frame=0', PHONE);
    await redIs(page, true);
    await page.getByRole('button', { name: 'Parts', exact: true }).tap();
    const line = (await panelOf(page).getByText('lid').boundingBox())!;
    const touch = await page.context().newCDPSession(page);
    const point = { x: line.x + 5, y: line.y + 5 };
    await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: [point] });
    await expect.poll(async () => panelOf(page).getByRole('checkbox', { name: 'box' }).isChecked()).toBe(false);
    await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
    await page.waitForTimeout(300);
    expect(await panelOf(page).getByRole('checkbox', { name: 'lid' }).isChecked()).toBe(true);
    const { bottom } = await modelBox(page);
    expect(bottom).toBeLessThan((await panelOf(page).boundingBox())!.y);
    expect(pages.errors).toEqual([]);
  });
});

/** The lowest place of the model in the picture, in CSS pixels. */
function modelBox(page: Page): Promise<{ bottom: number }> {
  return inViewer(
    page,
    async (viewer) => {
      const { stage } = viewer.player!;
      const positions = await viewer.readPositions(0);
      stage.decoder.place(positions);
      const m = stage.clipMatrix.elements;
      let bottom = 0;
      for (let k = 0; k < positions.length; k += 3) {
        const [x, y, z] = positions.subarray(k, k + 3);
        const w = m[3] * x + m[7] * y + m[11] * z + m[15];
        bottom = Math.max(bottom, (0.5 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w / 2) * stage.canvas.clientHeight);
      }
      return { bottom };
    },
    null,
  );
}

/** How many pixels of the picture are of a colour, and where they are in the mean; and how many differ from a picture without the model. */
function colorsOf(page: Page) {
  return inViewer(
    page,
    async (viewer) => {
      const player = viewer.player!;
      const pixels = async () => {
        const bitmap = await createImageBitmap(await player.picture());
        const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
        context.drawImage(bitmap, 0, 0);
        return context.getImageData(0, 0, bitmap.width, bitmap.height);
      };
      const { layers } = player;
      player.stage.setLayers({ ...layers, model: false, ground: false });
      const { data: empty } = await pixels();
      player.stage.setLayers({ ...layers, ground: false });
      const { data, width } = await pixels();
      player.stage.setLayers(layers);
      const found = { red: { count: 0, x: 0, y: 0 }, green: { count: 0, x: 0, y: 0 }, blue: { count: 0, x: 0, y: 0 } };
      let model = 0;
      for (let k = 0; k < data.length; k += 4) {
        const [r, g, b] = data.subarray(k, k + 3);
        if (Math.abs(r - empty[k]) + Math.abs(g - empty[k + 1]) + Math.abs(b - empty[k + 2]) > 24) model++;
        const name =
          r > 1.7 * g && r > 1.7 * b
            ? 'red'
            : g > 1.7 * r && g > 1.7 * b
              ? 'green'
              : b > 1.7 * r && b > 1.7 * g
                ? 'blue'
                : null;
        if (name === null) continue;
        const color = found[name];
        color.count++;
        color.x += ((k / 4) % width) / width;
        color.y += Math.floor(k / 4 / width);
      }
      for (const color of Object.values(found)) {
        color.x /= color.count;
        color.y /= color.count;
      }
      return { ...found, model };
    },
    null,
  );
}
