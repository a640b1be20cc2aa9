import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { seriousFindings } from './harness/axe';
import { PHONE } from './harness/browser';
import { chromium } from './harness/programs';
import { FilePages, goldenBytes } from './harness/viewing';

/** Small pictures that are lower than a phone that is held upright, and what they are. */
const LOW = [
  ['a phone that is held across', { ...PHONE, viewport: { width: 844, height: 390 } }],
  ['a window at 200 %', { viewport: { width: 640, height: 400 } }],
] as const;

describe.skipIf(chromium === undefined)('the viewer in a small picture', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();
  const shown = async (device: (typeof LOW)[number][1] | typeof PHONE) =>
    pages.show({ 'walk.cager': await goldenBytes('definition3-mvc.cager') }, undefined, device);

  it.each(LOW)('has all of the editor and of the tools within reach, of %s', async (_, device) => {
    const page = await shown(device);
    await page.keyboard.press('e');
    const panel = page.getByRole('region', { name: 'Edit cage' });
    await panel.waitFor();
    const [box, tools, title] = await Promise.all([panel, page.locator('.tools'), page.locator('.title')].map(boxOf));
    const deck = await boxOf(page.locator('.deck'));
    expect(box.height).toBeGreaterThan(200);
    expect(await page.locator('cager-timeline .chart').isVisible()).toBe(false);
    // Everything in the panel scrolls, none of it lies on anything else.
    const save = panel.getByRole('button', { name: 'Save .cager' });
    await save.scrollIntoViewIfNeeded();
    const last = await boxOf(save);
    expect(last.y + last.height).toBeLessThanOrEqual(box.y + box.height);
    expect(box.y + box.height).toBeLessThan(deck.y);
    expect(box.x + box.width).toBeLessThan(title.x);
    expect(title.x + title.width).toBeLessThan(tools.x);
    expect(box.x + box.width).toBeLessThan(tools.x);
    expect(tools.height).toBeGreaterThan(200);
    // The end of the tools fades while there are more.
    const fade = () => page.locator('.tools').evaluate((element) => getComputedStyle(element).maskImage);
    expect(await fade()).toContain('gradient');
    expect(await seriousFindings(page)).toEqual([]);
    expect(pages.errors).toEqual([]);
  });

  it('shows seconds, errors, and where playing begins and ends on a phone, and no legend behind a panel', async () => {
    const page = await shown(PHONE);
    for (const part of ['[data-clock]', '[data-l2]', '[data-linf]', '[data-action="in"]', '[data-action="out"]']) {
      const { x, width } = await boxOf(page.locator(`.deck ${part}`));
      expect(width).toBeGreaterThan(0);
      expect(x + width).toBeLessThanOrEqual(PHONE.viewport!.width);
    }
    await page.keyboard.press('h');
    const legend = page.getByText('Motion between frames');
    await legend.waitFor();
    await page.keyboard.press('i');
    await page.getByRole('complementary', { name: 'Statistics' }).waitFor();
    expect(await legend.isVisible()).toBe(false);
    expect(await seriousFindings(page)).toEqual([]);
    expect(pages.errors).toEqual([]);
  });
});

async function boxOf(part: ReturnType<Page['locator']>) {
  return (await part.boundingBox())!;
}
