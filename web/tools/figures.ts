/** Measures the viewer on the built-in demo and writes the table of docs/VIEWER.md. `MINUTES` (10) is how long the capture is looped. */

import { readFile, writeFile } from 'node:fs/promises';
import { cpus, loadavg } from 'node:os';
import type { Browser, BrowserContext, CDPSession, Page } from 'playwright-core';
import { readContents } from '../src/container/sectionReader';
import { bytesSource } from '../src/container/source';
import type { ViewerPage } from '../src/viewer/viewerPage';
import { launch } from '../tests/browser/harness/browser';
import { DemoSite } from './demoSite';

const MINUTES = Number(process.env.MINUTES ?? 10);
const DOCUMENT = new URL('../../docs/VIEWER.md', import.meta.url);
const [BEGIN, END] = ['<!-- figures: begin -->', '<!-- figures: end -->'];
const PAGE = /^\/($|assets\/)/;
const CAPTURE = /\/capture\.cager$/;
const OPENINGS = 5;
const FRAME_RATE = 30;
const WATCHED_SECONDS = 10;
const WARM_UP_SECONDS = 20;
const VIEWER = `document.querySelector('cager-viewer-page').shadowRoot.querySelector('cager-viewer')`;

interface Opening {
  /** Until the model is on the screen in its rest pose, and until the first decoded frame is. */
  readonly restSeconds: number;
  readonly frameSeconds: number;
  readonly pageBytes: number;
  readonly captureBytes: number;
}

if (loadavg()[0] > 0.5 * cpus().length) {
  process.stderr.write('This machine has other work to do: times and pictures per second are worse than they are.\n');
}
const site = await DemoSite.start();
const browser = await launch();
try {
  const id = await site.session('demo');
  const address = `${site.page}#/session/${id}`;
  const container = await site.container(id);
  const { chunks, frames } = await readContents(bytesSource(container));
  const staticBytes = (chunks[0].residual ?? chunks[0].frames).offset;

  const openings: Opening[] = [];
  for (let k = 0; k < OPENINGS; k += 1) {
    const { context, opening } = await opened(browser, address);
    await context.close();
    openings.push(opening);
  }
  const first = median(openings, (opening) => opening.pageBytes + opening.captureBytes);
  const seconds = (figure: (opening: Opening) => number) => `${median(openings, figure).toFixed(2)} s`;

  const { context, page } = await opened(browser, address);
  const picturesPerSecond = await pictures(page);
  // Slow machines pass frames over and still load them all.
  await page.waitForTimeout((1000 * frames) / FRAME_RATE);
  const pageBytes = site.meter.total(PAGE);
  const played = site.meter.total(CAPTURE) - staticBytes;
  const heap = await heapWhileLooping(await context.newCDPSession(page), page);
  await context.close();

  const raw = 12 * site.points * FRAME_RATE;
  const perSecond = (played / frames) * FRAME_RATE;
  const whole = pageBytes + staticBytes;
  await write([
    ['page, all parts of the viewer, gzipped', kilobytes(pageBytes), '230 kB'],
    ['static part of the container: model, cage', kilobytes(staticBytes), '–'],
    [
      'to the first decoded frame, page and capture',
      `${kilobytes(first)}, ${(first / whole).toFixed(2)} × of both`,
      '1.5 ×',
    ],
    ['time to the first picture: the rest pose, on loopback', seconds(({ restSeconds }) => restSeconds), '1.5 s'],
    ['time to the first decoded frame, on loopback', seconds(({ frameSeconds }) => frameSeconds), '–'],
    [
      `playing ${FRAME_RATE} frames in a second`,
      `${kilobytes(perSecond)}/s; raw frames ${kilobytes(raw)}/s, ${Math.round(raw / perSecond)} × as much`,
      '–',
    ],
    ['pictures per second, 1,280 × 800, drawn in software', picturesPerSecond.toFixed(0), '–'],
    [
      `JavaScript memory of the page, looping for ${MINUTES} minutes`,
      `${megabytes(heap.before)} at the beginning, ${megabytes(heap.after)} at the end`,
      'flat',
    ],
  ]);
} finally {
  await browser.close();
  await site.close();
}

/** A page in a context of its own, so that nothing is cached, once the first decoded frame is shown. */
async function opened(browser: Browser, address: string) {
  site.meter.reset();
  const context: BrowserContext = await browser.newContext({ viewport: { width: 1280, height: 800 } });
  const page = await context.newPage();
  await page.addInitScript(() => {
    // A picture is on the screen when the one after it may be drawn.
    const markShown = (name: string) =>
      requestAnimationFrame(() => requestAnimationFrame(() => performance.mark(name)));
    const markRest = () => {
      const page = document.querySelector<ViewerPage>('cager-viewer-page');
      if (page?.renderRoot.querySelector('cager-viewer')?.player) markShown('rest');
      else requestAnimationFrame(markRest);
    };
    markRest();
    document.addEventListener('ready', () => markShown('frame'));
  });
  await page.goto(address);
  const secondsTo = async (name: string) => {
    const found = await page.waitForFunction((mark) => performance.getEntriesByName(mark).at(0)?.startTime, name);
    return Number(await found.jsonValue()) / 1000;
  };
  const opening: Opening = {
    frameSeconds: await secondsTo('frame'),
    restSeconds: await secondsTo('rest'),
    pageBytes: site.meter.total(PAGE),
    captureBytes: site.meter.total(/^\/v1\//),
  };
  return { context, page, opening };
}

/** Pictures per second while the capture plays. */
async function pictures(page: Page): Promise<number> {
  return page.evaluate(
    (seconds) =>
      new Promise<number>((resolve) => {
        const began = performance.now();
        let count = 0;
        const next = () => {
          count += 1;
          const passed = (performance.now() - began) / 1000;
          if (passed < seconds) requestAnimationFrame(next);
          else resolve(count / passed);
        };
        requestAnimationFrame(next);
      }),
    WATCHED_SECONDS,
  );
}

/** Bytes that the page's JavaScript holds after a garbage collection: when all of the capture was played, and minutes later. */
async function heapWhileLooping(session: CDPSession, page: Page) {
  const held = async () => {
    await session.send('HeapProfiler.collectGarbage');
    return (await session.send('Runtime.getHeapUsage')) as { usedSize: number; backingStorageSize?: number };
  };
  const sum = ({ usedSize, backingStorageSize = 0 }: Awaited<ReturnType<typeof held>>) => usedSize + backingStorageSize;
  await page.waitForTimeout(1000 * WARM_UP_SECONDS);
  const before = sum(await held());
  await page.waitForTimeout(60_000 * MINUTES);
  const isPlaying = await page.evaluate(`${VIEWER}.player.transport.playing`);
  if (isPlaying !== true) throw new Error('The capture stopped playing, so nothing was measured.');
  return { before, after: sum(await held()) };
}

async function write(rows: readonly (readonly [string, string, string])[]): Promise<void> {
  const table = ['| what | measured | target |', '|---|---|---|', ...rows.map((row) => `| ${row.join(' | ')} |`)].join(
    '\n',
  );
  process.stdout.write(`${table}\n`);
  const text = await readFile(DOCUMENT, 'utf8');
  const [from, to] = [text.indexOf(BEGIN), text.indexOf(END)];
  if (from < 0 || to < from) throw new Error(`docs/VIEWER.md has no place for the table: ${BEGIN} … ${END}`);
  await writeFile(DOCUMENT, `${text.slice(0, from + BEGIN.length)}\n${table}\n${text.slice(to)}`);
}

function median<T>(of: readonly T[], figure: (one: T) => number): number {
  return of.map(figure).sort((a, b) => a - b)[Math.floor(of.length / 2)];
}

function kilobytes(bytes: number): string {
  return `${Math.round(bytes / 1000).toLocaleString('en')} kB`;
}

function megabytes(bytes: number): string {
  return `${(bytes / 1e6).toFixed(1)} MB`;
}
