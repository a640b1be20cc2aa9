/** Takes the pictures of the page and of a report in docs/pictures, of the built-in demo. */

import { mkdir, writeFile } from 'node:fs/promises';
import type { Browser, Page } from 'playwright-core';
import type { ViewerPage } from '../src/viewer/viewerPage';
import { launch } from '../tests/browser/harness/browser';
import { DemoComparison } from './demoComparison';
import { DemoSite } from './demoSite';
import { indexedPng } from './indexedPng';

const FOLDER = new URL('../../docs/pictures/', import.meta.url);
const DESKTOP = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844 };
/** Where the demo is well bent. */
const FRAME = 40;
const READY_MS = 90_000;
/** Edits the cage: chooses a vertex and moves it. */
const EDITING = ['e', 'Enter', 'Shift+ArrowUp', 'Shift+ArrowUp', 'Shift+ArrowUp'];

interface Picture {
  readonly name: string;
  readonly url: string;
  readonly viewport: typeof DESKTOP;
  readonly colorScheme: 'light' | 'dark';
  /** What shows that the page is there. */
  readonly shown: (page: Page) => Promise<unknown>;
  /** Keys that are pressed then. */
  readonly keys?: readonly string[];
}

const site = await DemoSite.start();
const comparison = await DemoComparison.of(site.demo);
const browser = await launch();
try {
  const id = await site.session('walk_v012');
  await site.session('jump_v003', 48, false);
  await site.session('turn_v007', 24);
  await mkdir(FOLDER, { recursive: true });
  const viewer = { url: `${site.page}#/session/${id}?frame=${FRAME}`, shown: modelShown };
  const list = { url: `${site.page}#/`, shown: (page: Page) => page.getByText('smaller').first().waitFor() };
  const upload = { url: `${site.page}#/upload`, shown: (page: Page) => page.getByRole('heading').first().waitFor() };
  const report = { url: comparison.url, shown: cagesShown };
  const pictures: readonly Picture[] = [
    { name: 'viewer-light', ...viewer, viewport: DESKTOP, colorScheme: 'light', keys: ['4'] },
    { name: 'viewer-dark', ...viewer, viewport: DESKTOP, colorScheme: 'dark', keys: ['i'] },
    { name: 'viewer-phone', ...viewer, viewport: PHONE, colorScheme: 'dark' },
    { name: 'editing-light', ...viewer, viewport: DESKTOP, colorScheme: 'light', keys: EDITING },
    { name: 'list-light', ...list, viewport: DESKTOP, colorScheme: 'light' },
    { name: 'list-phone', ...list, viewport: PHONE, colorScheme: 'dark' },
    { name: 'upload-dark', ...upload, viewport: DESKTOP, colorScheme: 'dark' },
    { name: 'report-light', ...report, viewport: DESKTOP, colorScheme: 'light' },
    { name: 'report-phone', ...report, viewport: PHONE, colorScheme: 'dark' },
  ];
  for (const picture of pictures) await take(browser, picture);
} finally {
  await browser.close();
  await site.close();
  await comparison.close();
}

async function take(browser: Browser, { name, url, viewport, colorScheme, shown, keys = [] }: Picture) {
  const context = await browser.newContext({ viewport, colorScheme, reducedMotion: 'reduce' });
  const page = await context.newPage();
  await page.goto(url);
  await shown(page);
  for (const key of keys) await page.keyboard.press(key);
  // Pictures become fine again when everything rests.
  await page.waitForTimeout(2000);
  const { pixels, width, height } = await pixelsOf(page, await page.screenshot({ timeout: READY_MS }));
  const png = indexedPng(pixels, width, height);
  await writeFile(new URL(`${name}.png`, FOLDER), png);
  process.stdout.write(`docs/pictures/${name}.png  ${Math.round(png.length / 1000)} kB\n`);
  await context.close();
}

async function modelShown(page: Page) {
  const isShown = () => {
    const viewer = document.querySelector<ViewerPage>('cager-viewer-page')?.renderRoot.querySelector('cager-viewer');
    const player = viewer?.player;
    return player?.stage.decoder.ready === true && player.progress === null && !player.playback.buffering;
  };
  await page.waitForFunction(isShown, undefined, { timeout: READY_MS });
}

/** Scrolls a report to the cages of its methods. */
async function cagesShown(page: Page) {
  await page.getByRole('link', { name: 'Cages' }).click();
}

/** The browser decodes its own picture. */
async function pixelsOf(page: Page, png: Buffer) {
  const { base64, width, height } = await page.evaluate(async (encoded) => {
    const bytes = Uint8Array.from(atob(encoded), (letter) => letter.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes]));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
    context.drawImage(image, 0, 0);
    const { data, width, height } = context.getImageData(0, 0, image.width, image.height);
    let text = '';
    for (let at = 0; at < data.length; at += 1 << 14) text += String.fromCharCode(...data.subarray(at, at + (1 << 14)));
    return { base64: btoa(text), width, height };
  }, png.toString('base64'));
  return { pixels: new Uint8Array(Buffer.from(base64, 'base64')), width, height };
}
