/** What tests do with the viewer on the page of files. */

import { readFile } from 'node:fs/promises';
import type { Browser, BrowserContextOptions, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll } from 'vitest';
import type { CagerViewer } from '../../../src/viewer/cagerViewer';
import type { ViewerPage } from '../../../src/viewer/viewerPage';
import { leave, openPage, sharedBrowser, type Watched } from './browser';
import { PageServer } from './pageServer';

const golden = new URL('../../../../tests/golden/', import.meta.url);

/** A file of the golden captures, copied: a Buffer of Node lies somewhere within a larger one. */
export async function goldenBytes(name: string): Promise<Uint8Array<ArrayBuffer>> {
  return Uint8Array.from(await readFile(new URL(name, golden)));
}

/** The page of files in a browser, without any service: started for all tests of a suite; each test has a page of its own. */
export class FilePages {
  private server!: PageServer;
  private browser!: Browser;
  private watched: Watched | null = null;

  /** To be called where the suite is described. */
  static ofSuite(): FilePages {
    const pages = new FilePages();
    beforeAll(async () => {
      pages.server = await PageServer.start(() => 'http://127.0.0.1:1');
      pages.browser = await sharedBrowser();
    }, 120_000);
    afterEach(() => pages.close());
    afterAll(async () => {
      await leave(pages.browser);
      pages.server.close();
    });
    return pages;
  }

  /** What the console and the policy of the page complained about. */
  get errors(): readonly string[] {
    return this.watched?.errors ?? [];
  }

  /** Opens the page and drops files on it, if there are any. */
  async open(
    files: Readonly<Record<string, Uint8Array>> = {},
    fragment = '#/file',
    device?: BrowserContextOptions,
  ): Promise<Page> {
    this.watched = await openPage(this.browser, `${this.server.base}${fragment}`, [], device);
    const { page } = this.watched;
    if (Object.keys(files).length > 0) await dropOnViewer(page, files);
    else await page.locator('cager-viewer').waitFor({ state: 'attached' });
    return page;
  }

  /** Opens the page, drops files on it and waits until the model can be seen. */
  async show(
    files: Readonly<Record<string, Uint8Array>>,
    fragment?: string,
    device?: BrowserContextOptions,
  ): Promise<Page> {
    const page = await this.open(files, fragment, device);
    await whenShown(page);
    return page;
  }

  async close(): Promise<void> {
    await this.watched?.close();
    this.watched = null;
  }
}

/** Drops files on the viewer. */
export async function dropOnViewer(page: Page, files: Readonly<Record<string, Uint8Array>>): Promise<void> {
  const encoded = Object.entries(files).map(([name, bytes]) => [name, Buffer.from(bytes).toString('base64')] as const);
  await page.locator('cager-viewer').waitFor({ state: 'attached' });
  await page.evaluate((entries) => {
    const dataTransfer = new DataTransfer();
    for (const [name, base64] of entries) {
      dataTransfer.items.add(new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], name));
    }
    const viewer = document.querySelector<ViewerPage>('cager-viewer-page')!.renderRoot.querySelector('cager-viewer')!;
    viewer.dispatchEvent(new DragEvent('drop', { dataTransfer, bubbles: true, composed: true, cancelable: true }));
  }, encoded);
}

/** Waits until the model can be seen. */
export async function whenShown(page: Page): Promise<void> {
  await page.waitForFunction(() => {
    const viewer = document.querySelector<ViewerPage>('cager-viewer-page')?.renderRoot.querySelector('cager-viewer');
    return viewer?.player?.stage.decoder.ready === true && viewer.player.progress === null;
  });
}

/** Runs something in the page with its viewer; `of` must not refer to anything outside but `argument`. */
export async function inViewer<T, A = null>(
  page: Page,
  of: (viewer: CagerViewer, argument: A) => T | Promise<T>,
  argument: A,
): Promise<T> {
  const viewer = "document.querySelector('cager-viewer-page').shadowRoot.querySelector('cager-viewer')";
  return page.evaluate(`(${of.toString()})(${viewer}, ${JSON.stringify(argument)})`);
}
