import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, test } from 'vitest';
import { seriousFindings } from './harness/axe';
import { openPage, type Watched } from './harness/browser';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';
import { dropOnViewer, inViewer, whenShown } from './harness/viewing';

const sphere = new SphereCapture();
/** Numbers of the frames of the capture with gaps. */
const NUMBERS = [0, 1, 5];

describe.skipIf(missing)('two captures in step', { timeout: 90_000 }, () => {
  let site: Site;
  let watched: Watched;
  let ids: { long: string; short: string };

  beforeAll(async () => {
    site = await Site.start();
    const client = site.client();
    ids = {
      long: await client.encode(sphere, { name: 'long walk' }, 12),
      short: await client.encode(sphere, { name: 'short walk', max_error: 2e-3 }, 8),
    };
  }, 120_000);

  afterAll(() => site.close());

  afterEach(() => watched.close());

  async function opened(fragment: string): Promise<Page> {
    watched = await openPage(site.browser, `${site.page}${fragment}`);
    await whenShown(watched.page);
    return watched.page;
  }

  test('a_second_session_is_chosen_from_the_list_and_stands_in_the_link', async () => {
    const page = await opened(`#/session/${ids.long}?frame=2`);
    await page.keyboard.press('b');
    await page.getByRole('dialog', { name: 'Compare with' }).waitFor();
    await page.getByRole('button', { name: /short walk/ }).waitFor();
    expect(await page.getByRole('button', { name: /long walk/ }).count()).toBe(0);
    expect(await seriousFindings(page)).toEqual([]);
    await page.getByRole('button', { name: /short walk/ }).click();
    await besideShown(page);
    await page.waitForFunction(
      (id) => location.hash.includes(`frame=2`) && location.hash.includes(`beside=${id}`),
      ids.short,
    );
    expect(await seriousFindings(page)).toEqual([]);

    await page.keyboard.press('b');
    await expect.poll(() => page.locator('cager-viewer .pane canvas').count()).toBe(1);
    await page.waitForFunction(() => !location.hash.includes('beside'));
    expect(watched.errors).toEqual([]);
  });

  test('a_link_shows_both_at_the_same_frame_from_the_same_side_with_the_errors_of_both', async () => {
    const page = await opened(`#/session/${ids.long}?frame=5&beside=${ids.short}`);
    await besideShown(page);
    await expect.poll(() => places(page)).toEqual([5, 5]);
    await page.getByText(/^L2 .* %$/).waitFor();
    const measured = await inViewer(
      page,
      (viewer) => {
        const { l2 } = viewer.pair.errors!;
        const own = viewer.pair.player!.capture.errors.l2;
        return {
          same: [...l2.subarray(0, own.length)].every((x, k) => x === own[k]),
          known: [...l2].filter(isFinite).length,
        };
      },
      null,
    );
    expect(measured).toEqual({ same: true, known: 8 });

    const free = (cover: string) =>
      inViewer(
        page,
        ({ pair, renderRoot }, part) => {
          const { stage } = pair.player!;
          const points = stage.decoder.readPositions();
          stage.decoder.place(points);
          const { elements: e } = stage.clipMatrix;
          const { left, width } = stage.canvas.getBoundingClientRect();
          const along = (row: number, at: number) =>
            e[row] * points[at] + e[row + 4] * points[at + 1] + e[row + 8] * points[at + 2] + e[row + 12];
          const rights = Array.from({ length: points.length / 3 }, (_, p) => along(0, 3 * p) / along(3, 3 * p));
          const right = left + ((1 + Math.max(...rights)) / 2) * width;
          return renderRoot.querySelector(part)!.getBoundingClientRect().left - right;
        },
        cover,
      );
    // Neither tools nor a panel cover anything of the second model.
    expect(await free('.tools')).toBeGreaterThan(0);
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor();
    await expect.poll(() => free('.panel')).toBeGreaterThan(0);
    // One picture has both in full, though the second one is wider by the panel.
    const [first, second] = await sizes(page);
    expect(second.width).toBeGreaterThan(first.width);
    const saving = page.waitForEvent('download');
    await page.keyboard.press('p');
    const png = await readFile(await (await saving).path());
    expect([png.readUInt32BE(16), png.readUInt32BE(20)]).toEqual([first.width + second.width, first.height]);
    await page.keyboard.press('i');
    await page.keyboard.press('d');
    await page.keyboard.press('4');
    await page.keyboard.press('End');
    await page.getByText('No frame 11 here').waitFor();
    await expect.poll(() => places(page)).toEqual([11, 7]);
    const looks = await inViewer(
      page,
      (viewer) =>
        [viewer.player!, viewer.pair.player!].map(({ controls, layers }) => [controls.destination, layers.cage]),
      null,
    );
    expect(looks[1]).toEqual(looks[0]);
    // The place is that of a frame which may still have to come.
    await expect
      .poll(() =>
        inViewer(page, (viewer) => [viewer.player!.playback.buffering, viewer.pair.player!.playback.buffering], null),
      )
      .toEqual([false, false]);
    // What the second picture shows is what its own capture decodes to.
    const [shown, alone] = await inViewer(
      page,
      async (viewer) => {
        const { stage } = viewer.pair.player!;
        return [[...stage.decoder.readPositions()], [...(await viewer.pair.player!.readPositions(7))]];
      },
      null,
    );
    expect(shown).toEqual(alone);

    await page.keyboard.press('Home');
    // From the loop by way of back and forth to once.
    await page.keyboard.press('l');
    await page.keyboard.press('l');
    await page.keyboard.press('k');
    await expect.poll(() => places(page), { timeout: 30_000 }).toEqual([11, 7]);
    expect(watched.errors).toEqual([]);
  });

  test('a_dropped_file_is_shown_instead_or_beside_and_frames_are_matched_by_their_numbers', async () => {
    const page = await opened(`#/session/${ids.long}?frame=3`);
    const gaps = await captureWithGaps();
    await dropOnViewer(page, { 'gaps.cager': gaps });
    await page.getByRole('button', { name: 'Open side by side' }).click();
    await besideShown(page);
    // Halfway between the frames 1 and 5.
    await page.getByText('No frame 3 here').waitFor();
    await expect.poll(() => places(page)).toEqual([3, 1.5]);
    for (let k = 0; k < 2; k += 1) await page.keyboard.press('ArrowRight');
    await expect.poll(() => page.getByText('No frame').count()).toBe(0);
    await expect.poll(() => places(page)).toEqual([5, 2]);

    await dropOnViewer(page, { 'gaps.cager': gaps });
    await page.getByRole('button', { name: 'Replace current' }).click();
    await page.waitForURL(/#\/file/);
    await whenShown(page);
    await inViewer(page, (viewer) => viewer.pause(), null);
    await page.keyboard.press('End');
    await page.getByText('5 / 5').waitFor();
    expect(await page.getByRole('slider', { name: 'Frame' }).getAttribute('aria-valuetext')).toMatch(/^frame 5/);
    expect(watched.errors).toEqual([]);
  });

  test('pictures_stand_above_each_other_on_a_phone_and_one_that_cannot_be_opened_leaves_the_other', async () => {
    const page = await opened(`#/session/${ids.long}?frame=5&beside=${ids.short}`);
    await besideShown(page);
    await page.setViewportSize({ width: 390, height: 844 });
    const boxes = async () =>
      Promise.all(['.pane.first', '.pane.second'].map((pane) => page.locator(`cager-viewer ${pane}`).boundingBox()));
    await expect.poll(async () => (await boxes())[1]!.width).toBe(390);
    const [first, second] = await boxes();
    expect(second!.y).toBeGreaterThanOrEqual(first!.y + first!.height - 1);
    expect(Math.abs(second!.height - first!.height)).toBeLessThanOrEqual(1);
    const [caption, errors] = ['.caption h2', '[data-beside]'].map((part) => page.locator(`cager-viewer ${part}`));
    expect(await errors.textContent()).toMatch(/L2/);
    // One line.
    expect((await errors.boundingBox())!.height).toBeLessThanOrEqual((await caption.boundingBox())!.height);
    expect(await seriousFindings(page)).toEqual([]);
    expect(watched.errors).toEqual([]);

    await page.evaluate(
      (id) => (location.hash = `#/session/${id}?frame=5&beside=00000000000000000000000000`),
      ids.long,
    );
    await page
      .getByRole('alert')
      .getByText(/^Could not open the second session/)
      .waitFor();
    await expect.poll(() => page.locator('cager-viewer .pane canvas').count()).toBe(1);
  });
});

/** Waits until the model of the second picture can be seen. */
async function besideShown(page: Page): Promise<void> {
  await page.waitForFunction(() => {
    const viewer = document.querySelector('cager-viewer-page')?.shadowRoot?.querySelector('cager-viewer');
    return viewer?.pair.player?.stage.decoder.ready === true && viewer.pair.player.progress === null;
  });
}

/** Places in both captures. */
function places(page: Page): Promise<number[]> {
  return inViewer(
    page,
    (viewer) => [viewer.player!, viewer.pair.player!].map((player) => player.transport.position),
    null,
  );
}

/** How large both pictures are in pixels. */
function sizes(page: Page): Promise<{ width: number; height: number }[]> {
  return inViewer(
    page,
    (viewer) =>
      [viewer.player!, viewer.pair.player!].map(
        ({
          stage: {
            canvas: { width, height },
          },
        }) => ({ width, height }),
      ),
    null,
  );
}

/** A container of frames with these {@link NUMBERS}. */
async function captureWithGaps(): Promise<Uint8Array> {
  const folder = await mkdtemp(join(tmpdir(), 'cager-web-'));
  try {
    const file = (name: string) => join(folder, name);
    await writeFile(file('rest.obj'), sphere.rest);
    await writeFile(file('cage.obj'), sphere.cage);
    for (const number of NUMBERS) await writeFile(file(`walk.${number}.obj`), sphere.frameObj(number));
    const inputs = ['--rest', file('rest.obj'), '--cage', file('cage.obj'), '--frames', file('walk.*.obj')];
    execFileSync(cager!, ['encode', ...inputs, '--allow-gaps', '--quiet', '-o', file('gaps.cager')], { stdio: 'pipe' });
    return await readFile(file('gaps.cager'));
  } finally {
    await rm(folder, { recursive: true });
  }
}
