/** Other graphics processors than the one that draws in software here. */

import type { Page } from 'playwright-core';

/** What WebGL calls the name of a graphics processor, and the longest side of its textures. */
const [RENDERER, MAX_TEXTURE_SIZE] = [0x9246, 0x0d33];

/** Has what the page opens from now on take this for a graphics processor whose textures are so large at the most: its shaders decode then. */
export async function pretendGraphics(page: Page, mostTexels = 8192): Promise<void> {
  await page.evaluate(
    (replaced: Readonly<Record<number, unknown>>) => {
      const { getParameter } = WebGL2RenderingContext.prototype;
      WebGL2RenderingContext.prototype.getParameter = function (name: number): unknown {
        return replaced[name] ?? getParameter.call(this, name);
      };
    },
    { [RENDERER]: 'A graphics processor', [MAX_TEXTURE_SIZE]: mostTexels },
  );
}
