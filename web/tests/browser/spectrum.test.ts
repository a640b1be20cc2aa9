import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { seriousFindings } from './harness/axe';
import { chromium } from './harness/programs';
import { FilePages, goldenBytes, inViewer } from './harness/viewing';

describe.skipIf(chromium === undefined)('singular values of a capture', { timeout: 90_000 }, () => {
  const pages = FilePages.ofSuite();

  async function opened(name: string): Promise<Page> {
    const page = await pages.show({ [`${name}.cager`]: await goldenBytes(`${name}.cager`) }, '#/file?frame=1');
    await page.keyboard.press('v');
    return page;
  }

  it('are those of the report, and each vector is painted on the cage and chosen by keyboard', async () => {
    const page = await opened('definition3-mvc');
    const slider = page.getByRole('slider', { name: 'Singular vector' });
    await slider.waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    const [values, report] = await inViewer(
      page,
      (viewer) => [
        [...viewer.spectrum.view!.spectrum!.values],
        viewer.player!.capture.static.report!.singular_values as number[],
      ],
      null,
    );
    expect(values).toHaveLength(26);
    for (const [k, value] of report.entries()) expect(Math.abs(values[k] / value - 1)).toBeLessThan(1e-6);
    await page.getByText('the last 1', { exact: true }).waitFor();

    const canvas = page.getByRole('img', { name: 'the model, drawn' });
    const picture = async () => {
      // Pictures become fine again when everything rests.
      await page.waitForTimeout(700);
      return canvas.screenshot();
    };
    const first = await picture();
    await page.keyboard.press('ArrowDown');
    await page.getByText('σ2', { exact: false }).waitFor();
    expect(first.equals(await picture())).toBe(false);
    await slider.focus();
    await page.keyboard.press('End');
    await expect.poll(() => slider.getAttribute('aria-valuetext')).toMatch(/^26 of 26/);
    // The slider's keys are not those of the player.
    expect(await inViewer(page, (viewer) => viewer.frame, null)).toBe(1);
    await page.keyboard.press('v');
    await expect.poll(() => slider.count()).toBe(0);
    expect(pages.errors).toEqual([]);
  });

  it('tell how far a move of the cage moves the model', async () => {
    const page = await opened('definition3-mvc');
    await page.getByRole('button', { name: 'x', exact: true }).click();
    const farthest = (k: number) =>
      inViewer(
        page,
        async (viewer, index) => {
          const still = await viewer.readPositions(1);
          viewer.spectrum.view!.index = index;
          let most = 0;
          // The swing is at its widest within any second and a bit.
          for (let look = 0; look < 20; look += 1) {
            await new Promise((resolve) => setTimeout(resolve, 80));
            const moved = viewer.player!.stage.decoder.readPositions();
            moved.forEach((x, at) => (most = Math.max(most, Math.abs(x - still[at]))));
          }
          return most / viewer.player!.stage.decoder.diagonal;
        },
        k,
      );
    const [strong, weak] = [await farthest(0), await farthest(25)];
    expect(strong).toBeGreaterThan(0.05);
    expect(strong).toBeLessThan(0.12);
    expect(weak).toBeLessThan(0.5 * strong);
    expect(pages.errors).toEqual([]);
  });

  it('include those of free normals, whose faces are painted', async () => {
    const page = await opened('definition3-green-free');
    await page.getByRole('button', { name: 'Normals of faces' }).click();
    await expect
      .poll(() => page.getByRole('button', { name: 'Normals of faces' }).getAttribute('aria-pressed'))
      .toBe('true');
    expect(await page.getByRole('slider', { name: 'Singular vector' }).getAttribute('max')).toBe('74');
    expect(pages.errors).toEqual([]);
  });

  it('are explained where they cannot be had', async () => {
    const page = await pages.open({ 'walk.cager': await goldenBytes('definition3-harmonic.cager') });
    await page
      .getByRole('alert')
      .getByText(/service/)
      .waitFor();
    await page.keyboard.press('v');
    await page
      .getByRole('alert')
      .getByText(/^Singular values need the coordinates/)
      .waitFor();
    expect(pages.errors).toEqual([]);
  });
});
