import type { Page } from 'playwright-core';
import { describe, expect, test } from 'vitest';
import { PHONE } from './harness/browser';
import { chromium } from './harness/programs';
import { FilePages, goldenBytes, inViewer } from './harness/viewing';

const DEVICES = [
  ['a desktop', { viewport: { width: 1280, height: 800 } }],
  ['a phone', PHONE],
] as const;

describe.skipIf(chromium === undefined)('a capture that travels', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();

  test.each(DEVICES)('stays_in_the_picture_of_%s_and_can_be_followed', async (_, device) => {
    const page = await pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') }, undefined, device);
    await travel(page);
    // It goes several times its size: what is followed can be seen.
    const button = page.getByRole('button', { name: 'Follow the model' });
    await expect.poll(() => button.getAttribute('aria-pressed')).toBe('true');
    const followed = await places(page);
    expect(followed.outside).toBeLessThan(0);
    expect(await page.evaluate(() => location.hash)).not.toContain('follow');
    await button.click();
    await expect.poll(() => button.getAttribute('aria-pressed')).toBe('false');
    await expect.poll(() => page.evaluate(() => location.hash)).toContain('follow=0');
    const { outside, height } = await places(page);
    expect(outside).toBeLessThan(0);
    // What is followed is larger than what is seen from as far as all of its way.
    expect(followed.height).toBeGreaterThan(2 * height);
    await page.keyboard.press('y');
    await expect.poll(() => button.getAttribute('aria-pressed')).toBe('true');
    expect(pages.errors).toEqual([]);
  });

  test('has_its_head_below_the_title_of_a_phone_while_figures_are_shown_and_the_cage_is_edited', async () => {
    const page = await pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') }, undefined, PHONE);
    await page.getByRole('button', { name: 'Statistics', exact: true }).tap();
    const panel = page.getByRole('complementary', { name: 'Statistics' });
    const [shown, tools] = [(await panel.boundingBox())!, (await page.locator('.tools').boundingBox())!];
    expect(shown.x + shown.width).toBeLessThanOrEqual(tools.x);
    await page.getByRole('button', { name: 'Close' }).tap();
    await expect.poll(() => panel.count()).toBe(0);
    await page.getByRole('button', { name: 'Edit cage' }).tap();
    await page.getByRole('region', { name: 'Edit cage' }).waitFor();
    expect((await places(page)).outside).toBeLessThan(0);
    await page.keyboard.press('e');
    await page.keyboard.press('o');
    await page.getByText('Drop the original frames here').waitFor();
    expect((await places(page)).outside).toBeLessThan(0);
    expect(pages.errors).toEqual([]);
  });

  test.each([
    [1280, 800],
    [1440, 900],
  ])('stays_between_the_panels_of_a_desktop_of_%d_by_%d', async (width, height) => {
    const device = { viewport: { width, height } };
    const page = await pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') }, undefined, device);
    await travel(page);
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor();
    expect((await places(page)).outside).toBeLessThan(0);
    await page.keyboard.press('e');
    await page.getByRole('region', { name: 'Edit cage' }).waitFor();
    expect((await places(page)).outside).toBeLessThan(0);
    await page.keyboard.press('e');
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor({ state: 'detached' });
    expect((await places(page)).outside).toBeLessThan(0);
    expect(pages.errors).toEqual([]);
  });

  test('stays_large_beside_the_narrower_of_two_panels_that_leave_no_room_for_it', async () => {
    const device = { viewport: { width: 768, height: 1024 } };
    const page = await pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') }, undefined, device);
    await travel(page);
    await page.keyboard.press('e');
    await page.getByRole('region', { name: 'Edit cage' }).waitFor();
    const { outside, height } = await places(page);
    expect(outside).toBeLessThan(0);
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor();
    const covered = await places(page, ['cager-edit-panel']);
    expect(covered.outside).toBeLessThan(0);
    expect(covered.height).toBeGreaterThan(0.9 * height);
    expect(pages.errors).toEqual([]);
  });

  test('is_saved_as_if_no_panel_were_open', async () => {
    const page = await pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') });
    // Seen from where somebody has put the camera, which panels do not move.
    await inViewer(page, (viewer) => (viewer.pause(), (viewer.frame = 0)), null);
    await page.mouse.move(600, 300);
    await page.mouse.wheel(0, -100);
    await page.waitForTimeout(800);
    const taken = () =>
      inViewer(
        page,
        async (viewer) => {
          const { player } = viewer;
          const picture = new Uint8Array(await (await player!.picture()).arrayBuffer());
          const { elements } = player!.stage.clipMatrix;
          return { picture: picture.join(' '), place: elements[12] };
        },
        null,
      );
    const before = await taken();
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor();
    await page.waitForTimeout(300);
    const after = await taken();
    expect(after.picture === before.picture).toBe(true);
    // What is seen still stands beside the panel.
    expect(after.place).toBeLessThan(before.place);
    expect(pages.errors).toEqual([]);
  });

  test('stays_where_somebody_has_put_the_camera', async () => {
    const page = await pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') });
    await inViewer(page, (viewer) => viewer.pause(), null);
    const distance = () => inViewer(page, ({ player }) => player!.controls.destination.distance, null);
    const before = await distance();
    await page.mouse.move(600, 300);
    await page.mouse.wheel(0, -300);
    await expect.poll(distance).toBeLessThan(before);
    const near = await distance();
    await page.setViewportSize({ width: 900, height: 700 });
    await page.waitForTimeout(300);
    expect(await distance()).toBe(near);
    await expect.poll(() => page.evaluate(() => location.hash)).toContain('camera=');
  });
});

/** Shows the capture anew, each frame two diagonals farther on than the one before. */
async function travel(page: Page): Promise<void> {
  await inViewer(
    page,
    async (viewer) => {
      viewer.pause();
      const { capture, stage } = viewer.player!;
      const step = 2 * stage.decoder.diagonal;
      const width = 3 * capture.static.rowsPerFrame;
      const blocks = await Promise.all(Array.from({ length: capture.frames }, (_, frame) => capture.block(frame)));
      const far = blocks.map(({ first, ...block }) => ({
        first,
        ...block,
        cages: block.cages.map((value, k) => value + (k % 3 === 0 ? step * (first + Math.floor(k / width)) : 0)),
      }));
      viewer.capture = {
        name: 'far.cager',
        static: capture.static,
        frames: capture.frames,
        complete: true,
        errors: capture.errors,
        frameNumbers: null,
        events: new EventTarget(),
        problem: null,
        block: (frame) => Promise.resolve(far[frame]),
        close: () => undefined,
      };
      await new Promise((resolve) => viewer.addEventListener('ready', resolve, { once: true }));
    },
    null,
  );
}

/**
 * By how many CSS pixels points of any frame are outside of what nothing covers, negative where all are within it, and how high the first frame is. On a phone
 * title, tools and transport cover some; on a desktop transport and `panels` alone, as the others stand beside the model.
 */
function places(page: Page, panels = ['.panel', 'cager-edit-panel']): Promise<{ outside: number; height: number }> {
  return inViewer(
    page,
    async (viewer, panels) => {
      viewer.pause();
      // As long as it takes until all frames are known and the camera rests.
      await new Promise((resolve) => setTimeout(resolve, 800));
      const { stage, capture } = viewer.player!;
      const { clientWidth, clientHeight } = stage.canvas;
      const boxOf = (part: string) => viewer.renderRoot.querySelector(part)!.getBoundingClientRect();
      const isPhone = clientWidth < 600;
      const top = isPhone ? boxOf('.lead').bottom : 0;
      const has = (part: string) => panels.includes(part) && viewer.renderRoot.querySelector(part) !== null;
      const right = isPhone ? boxOf('.tools').left : has('.panel') ? boxOf('.panel').left : clientWidth;
      const left = !isPhone && has('cager-edit-panel') ? boxOf('cager-edit-panel').right : 0;
      const bottom = boxOf('.deck').top;
      let [outside, low, high] = [-Infinity, Infinity, -Infinity];
      for (let frame = 0; frame < capture.frames; frame++) {
        viewer.frame = frame;
        await new Promise((resolve) => setTimeout(resolve, 100));
        const points = stage.decoder.readPositions();
        stage.decoder.place(points);
        const { elements } = stage.clipMatrix;
        for (let at = 0; at < points.length; at += 3) {
          const along = (row: number) =>
            elements[row] * points[at] +
            elements[row + 4] * points[at + 1] +
            elements[row + 8] * points[at + 2] +
            elements[row + 12];
          const x = ((along(0) / along(3) + 1) / 2) * clientWidth;
          const y = ((1 - along(1) / along(3)) / 2) * clientHeight;
          outside = Math.max(outside, along(3) > 0 ? Math.max(left - x, x - right, top - y, y - bottom) : Infinity);
          if (frame === 0) [low, high] = [Math.min(low, y), Math.max(high, y)];
        }
      }
      return { outside, height: high - low };
    },
    panels,
  );
}
