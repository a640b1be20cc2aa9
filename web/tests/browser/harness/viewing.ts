/** What tests do with the viewer on the page of files. */

import type { Page } from 'playwright-core';
import type { CagerViewer } from '../../../src/viewer/cagerViewer';
import type { ViewerPage } from '../../../src/viewer/viewerPage';

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
