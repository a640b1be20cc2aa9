import type { Page } from 'playwright-core';
import { describe, expect, test } from 'vitest';
import { openBytes, rawPart, withPart } from '../support/containers';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { FilePages, goldenBytes, inViewer } from './harness/viewing';

const ORANGE = [255, 128, 0];
const BLUE = [20, 40, 230];
/** Pixels that count as the model: it takes many more, and smoothed edges of anything else far fewer. */
const MANY = 3000;

describe.skipIf(chromium === undefined)('colours of the model', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();
  const opened = async (fragment = '#/file?frame=0') =>
    pages.show({ 'painted.cager': await painted(() => ORANGE) }, fragment);
  const theSwitch = (page: Page) => page.getByRole('button', { name: 'Colours', exact: true });

  test('are_drawn_until_the_switch_turns_them_off_and_stay_off_in_the_link', async () => {
    const page = await opened();
    expect(await theSwitch(page).getAttribute('aria-pressed')).toBe('true');
    const shown = await colorsOf(page);
    expect(shown.orange).toBeGreaterThan(MANY);
    // Light and gloss change the colour little; a mistake in its encoding would make it yellow or red.
    expect(shown.greenPerRed).toBeGreaterThan(0.4);
    expect(shown.greenPerRed).toBeLessThan(0.62);
    expect(await seriousFindings(page)).toEqual([]);

    await theSwitch(page).click();
    expect(await theSwitch(page).getAttribute('aria-pressed')).toBe('false');
    expect((await colorsOf(page)).orange).toBe(0);
    await page.waitForFunction(() => location.hash.endsWith('show=mg'));
    const fragment = await page.evaluate(() => location.hash);
    await pages.close();
    const again = await opened(fragment);
    expect((await colorsOf(again)).orange).toBe(0);
    await again.keyboard.press('7');
    expect((await colorsOf(again)).orange).toBeGreaterThan(MANY);
    expect(pages.errors).toEqual([]);
  });

  test('are_those_of_the_points_where_only_these_are_drawn', async () => {
    const page = await opened('#/file?frame=0&show=pk');
    expect((await colorsOf(page)).orange).toBeGreaterThan(100);
    await page.keyboard.press('7');
    expect((await colorsOf(page)).orange).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  test('belong_to_their_points_and_give_way_to_the_heat_map', async () => {
    const page = await pages.show(
      { 'painted.cager': await painted((x) => (x < 0.5 ? ORANGE : BLUE)) },
      '#/file?frame=0',
    );
    const { orange, blue, orangePlace, bluePlace } = await colorsOf(page);
    expect(Math.min(orange, blue)).toBeGreaterThan(MANY / 3);
    // From the front, x goes to the right.
    expect(orangePlace).toBeLessThan(bluePlace);
    await page.keyboard.press('h');
    await page.getByText('Motion between frames').waitFor();
    expect((await colorsOf(page)).orange).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  test('of_a_capture_beside_have_the_same_switch_which_others_do_not_have', async () => {
    const page = await pages.show({ 'plain.cager': await goldenBytes('definition3-mvc.cager') }, '#/file?frame=0');
    expect(await theSwitch(page).count()).toBe(0);
    const bytes = Buffer.from(await painted(() => ORANGE)).toString('base64');
    await inViewer(
      page,
      (viewer, base64) =>
        viewer.openBeside(new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], 'painted.cager')),
      bytes,
    );
    await theSwitch(page).waitFor();
    await expect.poll(() => inViewer(page, (viewer) => viewer.pair.player?.progress === null, null)).toBe(true);
    expect((await colorsOf(page, 'second')).orange).toBeGreaterThan(MANY / 3);
    expect((await colorsOf(page)).orange).toBe(0);
    await page.keyboard.press('7');
    await page.waitForTimeout(300);
    expect((await colorsOf(page, 'second')).orange).toBe(0);
    expect(pages.errors).toEqual([]);
  });
});

/** A capture whose points have colours by where they are from its one side, 0, to the other, 1. */
async function painted(colorAt: (x: number) => readonly number[]): Promise<Uint8Array<ArrayBuffer>> {
  const bytes = await goldenBytes('definition3-mvc.cager');
  const { rest } = (await openBytes(bytes)).static;
  const xs = [...rest.filter((_, k) => k % 3 === 0)];
  const [low, high] = [Math.min(...xs), Math.max(...xs)];
  const colors = Uint8Array.from(xs.flatMap((x) => colorAt((x - low) / (high - low))));
  return withPart(bytes, rawPart('rcol', colors), 'RFAC');
}

/** How many pixels of a picture are orange and blue, how far right these are in the mean, and how much green the orange has. */
function colorsOf(page: Page, which: 'first' | 'second' = 'first') {
  return inViewer(
    page,
    async (viewer, picture) => {
      const player = picture === 'first' ? viewer.player! : viewer.pair.player!;
      const bitmap = await createImageBitmap(await player.picture());
      const { width, height } = bitmap;
      const context = new OffscreenCanvas(width, height).getContext('2d')!;
      context.drawImage(bitmap, 0, 0);
      const { data } = context.getImageData(0, 0, width, height);
      let [orange, blue, orangePlace, bluePlace, greenPerRed] = [0, 0, 0, 0, 0];
      for (let k = 0; k < data.length; k += 4) {
        const [r, g, b] = data.subarray(k, k + 3);
        const x = ((k / 4) % width) / width;
        if (r > 90 && r > 1.4 * g && r > 1.8 * b) {
          orange++;
          orangePlace += x;
          greenPerRed += g / r;
        } else if (b > 90 && b > 1.8 * r && b > 1.8 * g) {
          blue++;
          bluePlace += x;
        }
      }
      return {
        orange,
        blue,
        orangePlace: orangePlace / orange,
        bluePlace: bluePlace / blue,
        greenPerRed: greenPerRed / orange,
      };
    },
    which,
  );
}
