/** A headless browser, and pages whose errors fail a test. */

import { type Browser, type BrowserContextOptions, type Page, chromium as launcher } from 'playwright-core';
import { chromium } from './programs';

const FLAGS = [
  '--no-sandbox',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
  '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader',
];

export function launch(): Promise<Browser> {
  return launcher.launch({ executablePath: chromium!, args: FLAGS });
}

let shared: Promise<Browser> | undefined;

/** The browser of all tests: starting one and compiling its shaders takes longer than most of them. It ends with their process. */
export function sharedBrowser(): Promise<Browser> {
  return (shared ??= launch());
}

/** Closes what tests of a file have left open in the browser. */
export async function leave(browser: Browser): Promise<void> {
  await Promise.all(browser.contexts().map((context) => context.close()));
}

/** A page in a context of its own, and what its console and its policy complained about. */
export interface Watched {
  readonly page: Page;
  /** Errors so far; those of answers a test provokes can be passed over by their text. */
  readonly errors: string[];
  close(): Promise<void>;
}

/** A phone that is held upright, under a finger; with as few pixels as a test can do with, since where things are does not depend on them. */
export const PHONE: BrowserContextOptions = {
  viewport: { width: 390, height: 844 },
  deviceScaleFactor: 0.5,
  isMobile: true,
  hasTouch: true,
};

/**
 * @param expected parts of messages that this test provokes, such as a status that it wants to see handled
 * @param device what the page is looked at with, such as {@link PHONE}
 */
export async function openPage(
  browser: Browser,
  url: string,
  expected: readonly string[] = [],
  device: BrowserContextOptions = {},
): Promise<Watched> {
  // A quarter of the pixels in each direction: drawing them is most of what tests would wait for.
  const context = await browser.newContext({
    acceptDownloads: true,
    viewport: { width: 1280, height: 800 },
    deviceScaleFactor: 0.25,
    ...device,
  });
  const page = await context.newPage();
  const errors: string[] = [];
  const note = (text: string): void => {
    // Some versions say that reading pixels takes time; tests read them.
    if (!['GL Driver Message (OpenGL, Performance', ...expected].some((part) => text.includes(part))) errors.push(text);
  };
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') note(`${message.text()} ${message.location().url}`);
  });
  page.on('pageerror', (error) => note(String(error)));
  await page.goto(url);
  return { page, errors, close: () => context.close() };
}

/** Makes the connection of a page as slow as so many bytes per second; as fast as it is where nothing is said. */
export async function slow(page: Page, to: { downloadThroughput?: number }): Promise<void> {
  const session = await page.context().newCDPSession(page);
  const unlimited = { offline: false, latency: 0, downloadThroughput: -1, uploadThroughput: -1 };
  await session.send('Network.emulateNetworkConditions', { ...unlimited, ...to });
}
