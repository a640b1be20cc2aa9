import { execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import type { Browser, Locator, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import { seriousFindings } from './harness/axe';
import { launch, openPage, type Watched } from './harness/browser';
import { cager, missing } from './harness/programs';

/** A capture whose name would end the script that holds the figures: a file in the folder `<`. */
const HOSTILE = '</script><b>walk.npy';

describe.skipIf(missing !== null)('reports that are opened as files', { timeout: 120_000 }, () => {
  let folder = '';
  let browser: Browser;
  let watched: Watched | null = null;

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'cager-report-'));
    run('demo --points 1500 --frames 14 --cage-vertices 80 -o demo');
    mkdirSync(join(folder, '<'));
    cpSync(join(folder, 'demo/decoded.npy'), join(folder, HOSTILE));
    run(
      `compare --rest demo/rest.obj --cage demo/cage.obj --frames ${HOSTILE} --coordinates mvc,green-free -o compared.html`,
    );
    run('cage --rest demo/rest.obj --vertices 60 -o cage.obj --picture cage.html');
    browser = await launch();
  }, 180_000);

  afterAll(async () => {
    await browser.close();
    rmSync(folder, { recursive: true });
  });

  afterEach(async () => {
    expect(watched?.errors).toEqual([]);
    await watched?.close();
    watched = null;
  });

  function run(line: string) {
    execFileSync(cager!, [...line.split(' '), '--quiet'], { cwd: folder, stdio: ['ignore', 'ignore', 'inherit'] });
  }

  async function opened(name: string): Promise<Page> {
    watched = await openPage(browser, pathToFileURL(join(folder, name)).href);
    await watched.page.getByRole('heading', { level: 1 }).waitFor();
    return watched.page;
  }

  it('shows every section of a comparison, with charts and views that are drawn', async () => {
    const page = await opened('compared.html');
    const asked: string[] = [];
    page.on('request', (request) => asked.push(request.url()));
    await page.reload();
    for (const title of [
      'paper says',
      'Errors',
      'Stability',
      'Spectra',
      'Maxvol, swap by swap',
      'Random',
      'Noise',
      'Singular',
      'Times',
    ]) {
      await page.getByRole('heading', { level: 2, name: title }).waitFor();
    }
    expect(await page.locator('.lead').textContent()).toContain(HOSTILE);
    expect(await page.locator('b:text("walk.npy")').count()).toBe(1);
    await charted(page, 14);
    await allDrawn(page.locator('report-views canvas'), 30);
    expect(asked.filter((url) => url !== page.url() && !url.startsWith('data:'))).toEqual([]);
    expect(await seriousFindings(page)).toEqual([]);
  });

  it('is used by keyboard alone', async () => {
    const page = await opened('compared.html');
    const radio = page.getByRole('radio', { name: 'mvc' });
    await radio.focus();
    await page.keyboard.press('ArrowRight');
    await page.getByRole('heading', { level: 2, name: 'Times green-free' }).waitFor();

    // A view turns with all of its group.
    const group = page.locator('report-views', { has: page.getByRole('group', { name: 'Cages of the methods' }) });
    const [first, last] = [group.locator('canvas').first(), group.locator('canvas').last()];
    await first.scrollIntoViewIfNeeded();
    await allDrawn(first, 1);
    const before = await pixels(last);
    await first.focus();
    await page.keyboard.press('ArrowRight');
    await expect.poll(() => pixels(last)).not.toBe(before);

    const frame = group.getByRole('slider');
    await frame.focus();
    await page.keyboard.press('Home');
    expect(await group.locator('output').textContent()).toBe('frame 0');

    const chart = page.locator('cager-chart').first();
    await chart.getByRole('img').focus();
    await page.keyboard.press('ArrowRight');
    await expect.poll(() => chart.locator('.reading').textContent()).toMatch(/^frame 0 · /);
    const series = chart.getByRole('button', { name: 'all points, data alone' });
    await series.press('Enter');
    expect(await series.getAttribute('aria-pressed')).toBe('false');
  });

  it('shows a part of a chart that is dragged across, and all of it again', async () => {
    const page = await opened('compared.html');
    const chart = page.locator('cager-chart').first();
    const labels = () => chart.locator('.x').allTextContents();
    const all = await labels();
    const area = chart.getByRole('img');
    await area.scrollIntoViewIfNeeded();
    const { x, y, width, height } = (await area.boundingBox())!;
    await page.mouse.move(x + 0.25 * width, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + 0.5 * width, y + height / 2);
    await page.mouse.up();
    await expect.poll(labels).not.toEqual(all);
    const [low, high] = [(await labels()).at(0), (await labels()).at(-1)].map(Number);
    expect([low >= Number(all.at(0)), high < Number(all.at(-1))]).toEqual([true, true]);
    await area.dblclick();
    await expect.poll(labels).toEqual(all);
  });

  it('fits a phone and the dark', async () => {
    const page = await opened('compared.html');
    await page.emulateMedia({ colorScheme: 'dark' });
    await page.setViewportSize({ width: 390, height: 844 });
    await charted(page, 1);
    expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(390);
    // No section hides behind the edge.
    const sections = page.getByRole('navigation', { name: 'Sections' });
    expect(await sections.evaluate((nav) => nav.scrollWidth - nav.clientWidth)).toBe(0);
    expect(await seriousFindings(page)).toEqual([]);
  });

  it('plays the demo', async () => {
    const page = await opened('demo/report.html');
    const [model] = await page.locator('report-views canvas').all();
    await allDrawn(page.locator('report-views canvas'), 2);
    await charted(page, 3);
    const before = await pixels(model);
    await page.getByRole('button', { name: 'Play' }).click();
    await expect.poll(() => pixels(model)).not.toBe(before);
    await page.getByRole('button', { name: 'Pause' }).click();
    expect(await page.getByRole('cell', { name: 'affine reproduction' }).count()).toBe(1);
    expect(await seriousFindings(page)).toEqual([]);
  });

  it('shows a cage, and saves its picture', async () => {
    const page = await opened('cage.html');
    await allDrawn(page.locator('report-views canvas'), 2);
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save PNG' }).click();
    expect((await download).suggestedFilename()).toMatch(/\.png$/);
    expect(await page.getByRole('cell', { name: 'points outside' }).count()).toBe(1);
    expect(await seriousFindings(page)).toEqual([]);
  });

  it('says so where it was damaged', async () => {
    const html = readFileSync(join(folder, 'cage.html'), 'utf8');
    writeFileSync(join(folder, 'damaged.html'), html.replace(/"kind":"cage"[^<]*/, ''));
    watched = await openPage(browser, pathToFileURL(join(folder, 'damaged.html')).href);
    expect(await watched.page.getByRole('alert').textContent()).toContain('create it again with cager');
  });
});

/** Waits until each of so many canvases or more shows something, each as it comes into sight. */
async function allDrawn(canvases: Locator, least: number) {
  await canvases.first().waitFor();
  const all = await canvases.all();
  expect(all.length).toBeGreaterThanOrEqual(least);
  for (const canvas of all) {
    const colors = async () => {
      await canvas.scrollIntoViewIfNeeded();
      return canvas.evaluate(colorCount);
    };
    await expect.poll(colors, { timeout: 20_000 }).toBeGreaterThan(5);
  }
}

/** Whether there are so many charts, each with a line or a mark within it. */
async function charted(page: Page, least: number) {
  const charts = await page.locator('cager-chart svg.plot').all();
  expect(charts.length).toBeGreaterThanOrEqual(least);
  for (const chart of charts) expect(await chart.locator('path:not(.grid)[d^=M]').count()).toBeGreaterThan(0);
}

function colorCount(canvas: Element): number {
  const { width, height } = canvas as HTMLCanvasElement;
  // Reading a canvas itself again and again makes the browser warn.
  const copy = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true })!;
  copy.drawImage(canvas as HTMLCanvasElement, 0, 0);
  const { data } = copy.getImageData(0, 0, width, height);
  return new Set(new Uint32Array(data.buffer)).size;
}

function pixels(canvas: Locator): Promise<string> {
  return canvas.evaluate((element) => (element as HTMLCanvasElement).toDataURL());
}
