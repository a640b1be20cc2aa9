import { readFile } from 'node:fs/promises';
import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { withEdits } from '../../src/container/rewrite';
import { bytesSource } from '../../src/container/source';
import { diagonalOf } from '../../src/coordinates/topology';
import { allBlocks, goldenBytes, openBytes, positionsOf, rawPart, withPart } from '../support/containers';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { FilePages, inViewer } from './harness/viewing';

/** The golden file with an edit of frame 1. */
async function edited(golden = goldenBytes('coded-mvc'), name = 'Nose') {
  const offsets = Float32Array.of(0.4, -0.2, 0.1, 0, 0.3, 0);
  const layer = { name, isOn: true, first: 1, count: 1, vertices: Uint32Array.of(3, 8), offsets };
  const container = await withEdits(bytesSource(golden), [layer]);
  return new Uint8Array(await container.arrayBuffer());
}

describe.skipIf(chromium === undefined)('a file with edits', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();

  it('is shown with them and its fine detail, and without them where they are switched off or removed', async () => {
    const bytes = await edited();
    const page = await pages.show({ 'nose.cager': bytes });
    for (const key of ['ArrowLeft', 'Home', 'ArrowRight']) await page.keyboard.press(key);
    const decoded = async (of: Uint8Array) => {
      const capture = await openBytes(of);
      const { length } = capture.static.rest;
      const positions = positionsOf(capture.static, await allBlocks(capture)).subarray(length, 2 * length);
      return { positions, diagonal: diagonalOf(capture.static.rest) };
    };
    const [plain, changed] = [await decoded(goldenBytes('coded-mvc')), await decoded(bytes)];
    const off = async (wanted: { positions: Float32Array; diagonal: number }) => {
      const shown = await readPositions(page, 1);
      return Math.max(...shown.map((x, k) => Math.abs(x - wanted.positions[k]))) / wanted.diagonal;
    };
    expect(await off(changed)).toBeLessThan(1e-5);
    expect(await off(plain)).toBeGreaterThan(1e-3);
    await page.getByText(/Edited · /).waitFor();
    const figure = () => page.locator('[data-linf]').textContent();
    await expect.poll(figure).toBe('–');

    await page.keyboard.press('e');
    const panel = page.getByRole('region', { name: 'Edit cage' });
    const shown = panel.getByRole('checkbox', { name: 'Enable Nose of the file, frames 1 to 1' });
    expect(await seriousFindings(page)).toEqual([]);
    await shown.uncheck();
    await expect.poll(() => off(plain)).toBeLessThan(1e-5);
    await expect.poll(figure).toMatch(/%/);
    await panel.getByRole('button', { name: 'Undo' }).click();
    await expect.poll(() => off(changed)).toBeLessThan(1e-5);
    await panel.getByRole('button', { name: 'Remove Nose of the file' }).click();
    await expect.poll(() => off(plain)).toBeLessThan(1e-5);
    await panel.getByText('No edits yet').waitFor();
    const save = panel.getByRole('button', { name: 'Save .cager' });
    const [file] = await Promise.all([page.waitForEvent('download'), save.click()]);
    expect(new Uint8Array(await readFile(await file.path()))).toEqual(goldenBytes('coded-mvc'));
    expect(pages.errors).toEqual([]);
  });

  it('of a shot from 1001 is listed by its numbers, with as much of its name as there is room for', async () => {
    const numbers = rawPart('fnum', new Uint8Array(Float64Array.of(1001, 1002, 1003).buffer), 8);
    const name = 'Sleeve of the left arm, as the director wanted it on Tuesday';
    const bytes = await edited(withPart(goldenBytes('coded-mvc'), numbers, 'ERRS'), name);
    const page = await pages.show({ 'shot.cager': bytes });
    await page.keyboard.press('e');
    const panel = page.getByRole('region', { name: 'Edit cage' });
    await panel.getByRole('checkbox', { name: `Enable ${name} of the file, frames 1002 to 1002` }).waitFor();
    const row = panel.getByRole('listitem');
    const clipped = await row.locator('.clip').evaluate((part) => part.scrollWidth > part.clientWidth);
    expect(clipped).toBe(true);
    const [list, ...shown] = await Promise.all(
      [row, row.getByText('saved'), row.getByText('1002', { exact: true })].map((part) => part.boundingBox()),
    );
    for (const part of shown) expect(part!.x + part!.width).toBeLessThanOrEqual(list!.x + list!.width);
    expect(pages.errors).toEqual([]);
  });

  it('leaves the progress uncovered where there is a message too', async () => {
    const page = await pages.show({ 'nose.cager': await edited() });
    await inViewer(
      page,
      (viewer) => {
        viewer.report('A point is not where it was.');
        viewer.say('Recording');
      },
      null,
    );
    const [message, progress] = [page.locator('.toast'), page.locator('.progress')];
    await progress.waitFor();
    const [above, below] = await Promise.all([message.boundingBox(), progress.boundingBox()]);
    expect(above!.y + above!.height).toBeLessThanOrEqual(below!.y);
  });
});

/** Positions that the viewer decodes for the picture. */
function readPositions(page: Page, frame: number): Promise<number[]> {
  return inViewer(page, async (viewer, wanted) => [...(await viewer.readPositions(wanted))], frame);
}
