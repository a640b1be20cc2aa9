import { describe, expect, it } from 'vitest';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { dropOnViewer, FilePages, goldenBytes, inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

describe.skipIf(chromium === undefined)('source and target of a transfer', { timeout: 120_000 }, () => {
  const pages = FilePages.ofSuite();

  it('are shown beside each other in colours of what corresponds, with the report that is dropped', async () => {
    const points = parseNpy(await goldenBytes('definition3-mvc.npy')).shape[1];
    const reversed = Array.from({ length: points }, (_, k) => points - 1 - k);
    const report = (correspondence: number[]) => Buffer.from(JSON.stringify({ method: 'fitted', correspondence }));
    const page = await pages.show({
      'man.cager': await goldenBytes('definition3-mvc.cager'),
      'woman.cager': await goldenBytes('coded-mvc.cager'),
      'walk.json': report(reversed),
    });
    await page.getByRole('heading', { name: 'man.cager', exact: true }).waitFor();
    await page.getByText('Matching colours mark corresponding points').waitFor();
    const colors = await inViewer(
      page,
      (viewer) =>
        [viewer.player!, viewer.pair.player!].map(({ stage, capture }) => {
          const model = (
            stage as unknown as { model: { uniforms: { colors: { value: { image: { data: Uint8Array } } } } } }
          ).model;
          return [...model.uniforms.colors.value.image.data.slice(0, (4 * capture.static.rest.length) / 3)];
        }),
      null,
    );
    const taken = reversed.flatMap((point) => colors[0].slice(4 * point, 4 * point + 4));
    expect(colors[1]).toEqual(taken);
    expect(new Set(colors[0]).size).toBeGreaterThan(8);
    expect(await seriousFindings(page)).toEqual([]);
    await page.setViewportSize({ width: 390, height: 844 });
    await expect.poll(() => page.locator('cager-viewer [data-beside]').isVisible()).toBe(false);
    expect(await seriousFindings(page)).toEqual([]);

    await dropOnViewer(page, { 'other.json': report([points, 0]) });
    await page.getByText('This report is about other models').waitFor();
    await page.keyboard.press('b');
    await expect.poll(() => page.getByText('Matching colours mark corresponding points').count()).toBe(0);
    await dropOnViewer(page, { 'walk.json': report(reversed) });
    await page.getByText('Show source and target side by side first').waitFor();
    expect(pages.errors).toEqual([]);
  });

  it('are in these colours where the target is a transfer of the service', async () => {
    const container = await goldenBytes('definition3-mvc.cager');
    const points = parseNpy(await goldenBytes('definition3-mvc.npy')).shape[1];
    const page = await pages.open();
    let [looks, state] = [0, 'running'];
    await page.route('**/v1/transfers/**', async (route) => {
      const path = new URL(route.request().url()).pathname;
      if (path.endsWith('/capture.cager')) await route.fulfill({ body: Buffer.from(container) });
      else if (path.endsWith('/report'))
        await route.fulfill({ json: { correspondence: Array.from({ length: points }, (_, k) => k) } });
      else {
        looks++;
        await route.fulfill({ json: { name: 'walk of a woman', state, frames: 3, moved: 1 } });
      }
    });
    await page.evaluate(() => (location.hash = '#/transfer/abc'));
    await page.getByText('Transferred 1 of 3 frames').waitFor();
    state = 'completed';
    await whenShown(page);
    expect(looks).toBeGreaterThan(1);
    await page.getByRole('heading', { name: 'walk of a woman' }).waitFor();
    await dropOnViewer(page, { 'man.cager': await goldenBytes('coded-mvc.cager') });
    await page.getByRole('button', { name: 'Open side by side' }).click();
    await page.getByText('Matching colours mark corresponding points').waitFor();
    expect(pages.errors).toEqual([]);
  });
});
