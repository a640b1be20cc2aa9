import { describe, expect, test } from 'vitest';
import { diagonalOf } from '../../src/coordinates/topology';
import { pretendGraphics } from './harness/device';
import { chromium } from './harness/programs';
import { dropOnViewer, FilePages, goldenBytes, inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

describe.skipIf(chromium === undefined)('shaders of a graphics processor', { timeout: 60_000 }, () => {
  const pages = FilePages.ofSuite();

  test.each(['definition3-green', 'definition3-green-free', 'coded-mvc'])(
    'decode_%s_to_the_positions_that_the_program_decodes',
    async (name) => {
      const page = await pages.open({}, '#/file?frame=0');
      await pretendGraphics(page);
      await dropOnViewer(page, { [`${name}.cager`]: await goldenBytes(`${name}.cager`) });
      await whenShown(page);
      const { shape, values } = parseNpy(await goldenBytes(`${name}.npy`));
      const length = 3 * shape[1];
      for (const frame of [0, shape[0] - 1]) {
        const found = await inViewer(page, async (viewer, wanted) => [...(await viewer.readPositions(wanted))], frame);
        expect(found).toHaveLength(length);
        const farthest = found.reduce((most, x, k) => Math.max(most, Math.abs(x - values[length * frame + k])), 0);
        expect(farthest / diagonalOf(values.subarray(0, length)), `frame ${frame}`).toBeLessThan(1e-4);
      }
      expect(pages.errors).toEqual([]);
    },
  );
});
