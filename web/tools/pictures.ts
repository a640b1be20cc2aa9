/**
 * Takes the pictures of the page and of a report in docs/pictures, of the built-in demo; and of a walk and a recovery, where `CAGER_CAPTURES` names the captures.
 * `ONLY=walk,viewer-dark` takes those alone whose names begin so.
 */

import { execFileSync } from 'node:child_process';
import { mkdir, mkdtemp, readdir, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { CagerViewer } from '../src/viewer/cagerViewer';
import type { ViewerPage } from '../src/viewer/viewerPage';
import { launch } from '../tests/browser/harness/browser';
import { cager } from '../tests/browser/harness/programs';
import { dropOnViewer, inViewer } from '../tests/browser/harness/viewing';
import { parseNpy } from '../tests/browser/npy';
import { DemoComparison } from './demoComparison';
import { DemoSite } from './demoSite';
import { indexedPng } from './indexedPng';

const FOLDER = new URL('../../docs/pictures/', import.meta.url);
const DESKTOP = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844 };
/** Where the demo is well bent. */
const FRAME = 40;
const READY_MS = 90_000;
/** What names of the pictures to take begin with; all where nothing is said. */
const ONLY = (process.env.ONLY ?? '').split(',');
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
  await mkdir(FOLDER, { recursive: true });
  const empty = (page: Page) => page.getByRole('heading', { name: 'No sessions yet' }).waitFor();
  const begin = { url: `${site.page}#/`, shown: empty };
  await take(browser, { name: 'empty-light', ...begin, viewport: DESKTOP, colorScheme: 'light' });
  const id = await site.session('walk_v012');
  await site.session('jump_v003', 48, false);
  const other = await site.session('turn_v007', 24);
  const viewer = { url: `${site.page}#/session/${id}?frame=${FRAME}`, shown: modelShown };
  const both = { url: `${site.page}#/session/${other}?frame=12&beside=${id}`, shown: bothShown };
  const list = { url: `${site.page}#/`, shown: (page: Page) => page.getByText('smaller').first().waitFor() };
  const upload = { url: `${site.page}#/upload`, shown: (page: Page) => page.getByRole('heading').first().waitFor() };
  const report = { url: comparison.url, shown: cagesShown };
  const pictures: readonly Picture[] = [
    { name: 'viewer-light', ...viewer, viewport: DESKTOP, colorScheme: 'light', keys: ['4'] },
    { name: 'viewer-dark', ...viewer, viewport: DESKTOP, colorScheme: 'dark', keys: ['i'] },
    { name: 'viewer-phone', ...viewer, viewport: PHONE, colorScheme: 'dark' },
    { name: 'editing-light', ...viewer, viewport: DESKTOP, colorScheme: 'light', keys: EDITING },
    { name: 'editing-phone', ...viewer, viewport: PHONE, colorScheme: 'dark', keys: EDITING },
    { name: 'heat-light', ...viewer, viewport: DESKTOP, colorScheme: 'light', keys: ['h'] },
    { name: 'beside-dark', ...both, viewport: DESKTOP, colorScheme: 'dark' },
    { name: 'beside-phone', ...both, viewport: PHONE, colorScheme: 'light' },
    { name: 'list-light', ...list, viewport: DESKTOP, colorScheme: 'light' },
    { name: 'list-phone', ...list, viewport: PHONE, colorScheme: 'dark' },
    { name: 'upload-dark', ...upload, viewport: DESKTOP, colorScheme: 'dark' },
    { name: 'report-light', ...report, viewport: DESKTOP, colorScheme: 'light' },
    { name: 'report-phone', ...report, viewport: PHONE, colorScheme: 'dark' },
  ];
  for (const picture of pictures) await take(browser, picture);
  const captures = process.env.CAGER_CAPTURES;
  if (captures) {
    const walk = lazily(() => walkOf(captures));
    const recovery = lazily(() => recovered(captures));
    const url = `${site.page}#/file`;
    const ofWalk = (place: number) => ({
      url,
      shown: async (page: Page) => walkShown(page, await walk(), place),
    });
    const ofRecovery = { url, shown: async (page: Page) => recoveryShown(page, await recovery()) };
    const places = { first: 0, middle: 0.5, last: 1 };
    for (const [name, place] of Object.entries(places)) {
      await take(browser, { name: `walk-${name}-light`, ...ofWalk(place), viewport: DESKTOP, colorScheme: 'light' });
      await take(browser, { name: `walk-${name}-phone`, ...ofWalk(place), viewport: PHONE, colorScheme: 'dark' });
    }
    await take(browser, { name: 'recovery-light', ...ofRecovery, viewport: DESKTOP, colorScheme: 'light' });
    await take(browser, { name: 'recovery-phone', ...ofRecovery, viewport: PHONE, colorScheme: 'dark' });
  }
} finally {
  await browser.close();
  await site.close();
  await comparison.close();
}

async function take(browser: Browser, { name, url, viewport, colorScheme, shown, keys = [] }: Picture) {
  if (!ONLY.some((beginning) => name.startsWith(beginning))) return;
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

async function bothShown(page: Page) {
  await modelShown(page);
  const isShown = () => {
    const viewer = document.querySelector<ViewerPage>('cager-viewer-page')?.renderRoot.querySelector('cager-viewer');
    return viewer?.pair.player?.stage.decoder.ready === true && viewer.pair.player.progress === null;
  };
  await page.waitForFunction(isShown, undefined, { timeout: READY_MS });
}

/** Makes something when it is first asked for, and gives the same from then on. */
function lazily<T>(make: () => Promise<T>): () => Promise<T> {
  let made: Promise<T> | undefined;
  return () => (made ??= make());
}

/** The container of `anny-man-02_02`. */
async function walkOf(captures: string): Promise<Uint8Array> {
  const made = await mkdtemp(join(tmpdir(), 'cager-walk-'));
  try {
    const output = join(made, 'walk.cager');
    const [rest, frames] = ['rest.obj', 'frames.npy'].map((name) => join(captures, 'anny-man-02_02', name));
    const inputs = ['--rest', rest, '--frames', frames, '--fps', '30', '--max-error', '0.001'];
    execFileSync(cager!, ['encode', ...inputs, '-o', output, '--quiet'], { stdio: 'inherit' });
    return await readFile(output);
  } finally {
    await rm(made, { recursive: true });
  }
}

/** Shows the walk as somebody sees it who opens the file, in the frame at a place between 0, the first one, and 1. */
async function walkShown(page: Page, container: Uint8Array, place: number) {
  await dropOnViewer(page, { 'walk.cager': container });
  await modelShown(page);
  await inViewer(page, (viewer) => void (viewer.up = 'z'), null);
  const show = (viewer: CagerViewer, at: number) => {
    viewer.frame = Math.round(at * (viewer.player!.capture.frames - 1));
  };
  await inViewer(page, show, place);
}

/** What a recovery of the first frame of `anny-man-02_02` makes of the surfaces of `observed-example`, and these themselves. */
async function recovered(captures: string) {
  const [folder, truth] = ['observed-example', 'anny-man-02_02'].map((name) => join(captures, name));
  const surfaces = (await readdir(folder)).filter((name) => name.endsWith('.ply')).sort();
  const made = await mkdtemp(join(tmpdir(), 'cager-recovery-'));
  try {
    const [container, report] = ['walk.cager', 'walk.json'].map((name) => join(made, name));
    const { shape, values } = parseNpy(await readFile(join(truth, 'frames.npy')));
    const points = Array.from({ length: shape[1] }, (_, p) => `v ${values.slice(3 * p, 3 * p + 3).join(' ')}`);
    const faces = (await readFile(join(truth, 'rest.obj'), 'utf8')).match(/^f .*$/gm)!;
    const template = join(made, 'template.obj');
    await writeFile(template, [...points, ...faces].join('\n'));
    const inputs = ['--template', template, '--frames', join(folder, '*.ply')];
    execFileSync(cager!, ['recover', ...inputs, '-o', container, '--report', report, '--quiet'], { stdio: 'inherit' });
    const read = async (names: readonly string[], from: string) =>
      Object.fromEntries(
        await Promise.all(names.map(async (name) => [name, await readFile(join(from, name))] as const)),
      );
    return { made: await read(['walk.cager', 'walk.json'], made), surfaces: await read(surfaces, folder) };
  } finally {
    await rm(made, { recursive: true });
  }
}

/** Shows a recovery with its surfaces, in the frame that lies worst. */
async function recoveryShown(page: Page, { made, surfaces }: Awaited<ReturnType<typeof recovered>>) {
  await dropOnViewer(page, made);
  await modelShown(page);
  await inViewer(page, (viewer) => void (viewer.up = 'z'), null);
  await dropOnViewer(page, surfaces);
  await page.keyboard.press('m');
  await page.getByText('Distance from the surface').waitFor({ timeout: READY_MS });
  await page.waitForTimeout(5000);
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
