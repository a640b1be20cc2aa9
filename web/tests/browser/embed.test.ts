import { type Server, createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { openPage } from './harness/browser';
import { missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';

describe.skipIf(missing)('a viewer in a page of another origin', { timeout: 60_000 }, () => {
  let site: Site;
  let other: Server;
  let origin: string;
  let html = '';

  beforeAll(async () => {
    other = createServer((_asked, answer) => answer.writeHead(200, { 'Content-Type': 'text/html' }).end(html));
    await new Promise<void>((resolve) => other.listen(0, '127.0.0.1', resolve));
    origin = `http://127.0.0.1:${(other.address() as AddressInfo).port}`;
    site = await Site.start({}, [`allowed_origins=${origin}`]);
  }, 120_000);

  afterAll(async () => {
    await site.close();
    other.close();
  });

  test('it_plays_a_coded_session_and_tells_of_its_frames', async () => {
    const id = await site.client().encode(new SphereCapture(), { name: 'embedded', max_error: 1e-3 }, 12);
    const address = `${site.service.origin}/v1/sessions/${id}/capture.cager`;
    html = `<!doctype html><link rel="icon" href="data:," /><script type="module" src="${site.server.base}cager-viewer.js"></script>
      <cager-viewer autoplay style="height: 400px" src="${address}"></cager-viewer>`;
    const { page, errors, close } = await openPage(site.browser, 'about:blank');
    await page.addInitScript(() => {
      const told: string[] = [];
      for (const type of ['ready', 'framechange', 'problem']) {
        document.addEventListener(type, (event) => told.push(`${type} ${String((event as CustomEvent).detail)}`));
      }
      Object.assign(window, { told });
    });
    await page.goto(origin);
    const told = () => page.evaluate(() => (window as unknown as { told: string[] }).told);
    await expect.poll(told, { timeout: 30_000 }).toContain('ready null');
    await expect.poll(told, { timeout: 30_000 }).toContain('framechange 5');
    expect((await told()).filter((text) => text.startsWith('problem'))).toEqual([]);
    expect(errors).toEqual([]);
    await close();
  });
});
