import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { openBytes } from '../support/containers';
import { diagonalOf } from '../../src/coordinates/topology';
import { npyHeader } from '../../src/editing/exporter';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { dropOnViewer, FilePages, goldenBytes, inViewer } from './harness/viewing';
import { parseNpy } from './npy';

/** The point that is moved in the original, and how far, as a fraction of the diagonal. */
const [MOVED, DISTANCE] = [5, 0.03];
/** What the picture's own rounding may add. */
const ROUNDING = 1e-4;

describe.skipIf(chromium === undefined)('a capture beside its original', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();
  const opened = async () => pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') });

  it('says where the original could come from, and shows distances that are known', async () => {
    const page = await opened();
    await page.keyboard.press('Home');
    await page.keyboard.press('h');
    await page.keyboard.press('h');
    await page.getByText('They are not uploaded').waitFor();
    expect(await seriousFindings(page)).toEqual([]);

    const { bytes, points } = await movedOriginal();
    await dropOnViewer(page, { 'walk.npy': bytes });
    await page.getByText('Error against the original').waitFor();
    for (const frame of [0, 2]) {
      await inViewer(page, (viewer, wanted) => void (viewer.pause(), (viewer.frame = wanted)), frame);
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
    expect(pages.errors).toEqual([]);
  });

  it('has colours that depend on the frame and not on what was watched before', async () => {
    const page = await opened();
    await inViewer(page, (viewer) => viewer.pause(), null);
    await page.keyboard.press('Home');
    await page.keyboard.press('h');
    await page.getByRole('group', { name: /^Colour range/ }).waitFor();
    const largest = async (frame: number) => {
      await inViewer(page, (viewer, wanted) => (viewer.frame = wanted), frame);
      await page.waitForTimeout(300);
      return inViewer(page, (viewer) => viewer.player!.heatMap.largest, null);
    };
    const clip = await largest(0);
    expect(clip).toBeGreaterThan(0);
    expect([await largest(1), await largest(0)]).toEqual([clip, clip]);
    await page.getByRole('button', { name: 'This frame' }).click();
    const ofFrames = [await largest(0), await largest(1)];
    expect(ofFrames[0]).not.toBe(ofFrames[1]);
    expect([await largest(0), await largest(1)]).toEqual(ofFrames);
    await dropOnViewer(page, { 'walk.npy': (await movedOriginal()).bytes });
    await page.getByText('Error against the original').waitFor();
    await page.getByRole('button', { name: 'Whole clip' }).click();
    // Once frames of the whole clip have been measured.
    await expect
      .poll(async () => new Set([await largest(0), await largest(1), await largest(2), await largest(0)]).size)
      .toBe(1);
    expect(pages.errors).toEqual([]);
  });

  it('shows original and decoded model with one camera, and the line between them moves by keyboard', async () => {
    const page = await opened();
    await dropOnViewer(page, { 'walk.npy': (await movedOriginal()).bytes });
    await page.getByText('Error against the original').waitFor();
    await page.keyboard.press('o');
    await expect.poll(() => page.getByRole('button', { name: 'Both' }).getAttribute('aria-pressed')).toBe('true');
    const line = page.getByRole('slider', { name: 'Divider between original and decoded' });
    await line.focus();
    const before = Number(await line.getAttribute('aria-valuenow'));
    await page.keyboard.press('ArrowLeft');
    await expect.poll(() => line.getAttribute('aria-valuenow')).toBe(String(before - 2));
    expect(await seriousFindings(page)).toEqual([]);
    const canvas = page.getByRole('img', { name: '3D view' });
    const both = await canvas.screenshot();
    await page.getByRole('button', { name: 'Ghost' }).click();
    await expect.poll(async () => both.equals(await canvas.screenshot())).toBe(false);
    const ghost = await canvas.screenshot();
    await page.getByRole('button', { name: 'Original', exact: true }).click();
    await expect.poll(async () => ghost.equals(await canvas.screenshot())).toBe(false);
    await page.getByRole('button', { name: 'Close the original' }).click();
    await expect.poll(() => page.getByRole('button', { name: 'Both' }).count()).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  it('has the line between both begin at the middle of the model beside a panel, and follow it', async () => {
    const page = await opened();
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor();
    await dropOnViewer(page, { 'walk.npy': (await movedOriginal()).bytes });
    await page.getByText('Error against the original').waitFor();
    await inViewer(page, (viewer) => viewer.pause(), null);
    await page.keyboard.press('Home');
    await page.waitForTimeout(800);
    await page.keyboard.press('o');
    const line = page.getByRole('slider', { name: 'Divider between original and decoded' });
    await line.waitFor();
    const middle = async () => {
      const { x, width } = (await line.boundingBox())!;
      return x + width / 2;
    };
    // How far the line is from the middle of the model, and from where it is drawn, in CSS pixels.
    const away = async () => {
      const at = await middle();
      const { model, drawn } = await inViewer(
        page,
        ({ player }) => {
          const { stage } = player!;
          const left = stage.canvas.getBoundingClientRect().left;
          const points = stage.decoder.readPositions();
          stage.decoder.place(points);
          const { elements: e } = stage.clipMatrix;
          const along = (row: number, at: number) =>
            e[row] * points[at] + e[row + 4] * points[at + 1] + e[row + 8] * points[at + 2] + e[row + 12];
          const rights = Array.from({ length: points.length / 3 }, (_, p) => along(0, 3 * p) / along(3, 3 * p));
          const share = (2 + Math.min(...rights) + Math.max(...rights)) / 4;
          return { model: left + share * stage.canvas.clientWidth, drawn: left + stage.line };
        },
        null,
      );
      return { model: Math.abs(at - model), drawn: Math.abs(at - drawn) };
    };
    const isClose = async () => {
      const { model, drawn } = await away();
      return model < 40 && drawn < 1;
    };
    await expect.poll(isClose).toBe(true);
    const beside = await middle();
    await page.keyboard.press('i');
    await expect.poll(isClose).toBe(true);
    expect(await middle()).toBeGreaterThan(beside + 100);

    const { y, height } = (await line.boundingBox())!;
    await page.keyboard.press('i');
    await expect.poll(middle).toBeCloseTo(beside, 0);
    await page.mouse.move(beside, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(beside - 80, y + height / 2);
    await page.mouse.up();
    await expect.poll(middle).toBeCloseTo(beside - 80, 0);
    expect(pages.errors).toEqual([]);
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
      .getByText(/No frames found/)
      .waitFor();
    expect(pages.errors).toEqual([]);
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

/** What the program decodes, with one point moved along x: farther from frame to frame. */
async function movedOriginal(): Promise<{ bytes: Uint8Array; points: number }> {
  const decoded = parseNpy(await goldenBytes('definition3-mvc.npy'));
  const diagonal = diagonalOf((await openBytes(await goldenBytes('definition3-mvc.cager'))).static.rest);
  const [frames, points] = decoded.shape;
  const moved = Float32Array.from(decoded.values);
  for (let frame = 0; frame < frames; frame++) moved[3 * (points * frame + MOVED)] += DISTANCE * (1 + frame) * diagonal;
  return { bytes: Buffer.concat([npyHeader(decoded.shape), Buffer.from(moved.buffer)]), points };
}
