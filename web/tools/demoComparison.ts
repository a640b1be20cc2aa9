/** The report of `cager compare` on the built-in demo. */

import { execFileSync } from 'node:child_process';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { cager } from '../tests/browser/harness/programs';
import type { Demo } from './demoSite';

/** Frames that are measured: enough for charts, and soon done. */
const FRAMES = 60;

export class DemoComparison {
  private constructor(private readonly folder: string) {}

  static async of({ rest, cage, shape, frames }: Demo): Promise<DemoComparison> {
    const folder = await mkdtemp(join(tmpdir(), 'cager-report-'));
    const [, points] = shape;
    const header = `{'descr': '<f4', 'fortran_order': False, 'shape': (${FRAMES}, ${points}, 3), }`.padEnd(117) + '\n';
    const start = Uint8Array.of(0x93, ...new TextEncoder().encode('NUMPY'), 1, 0, header.length, 0);
    await Promise.all([
      writeFile(join(folder, 'rest.obj'), rest),
      writeFile(join(folder, 'cage.obj'), cage),
      writeFile(
        join(folder, 'walk.npy'),
        Buffer.concat([start, Buffer.from(header), new Uint8Array(frames.slice(0, 3 * points * FRAMES).buffer)]),
      ),
    ]);
    const line =
      'compare --rest rest.obj --cage cage.obj --frames walk.npy --coordinates mvc,harmonic -o report.html --quiet';
    execFileSync(cager!, line.split(' '), { cwd: folder, stdio: ['ignore', 'ignore', 'inherit'] });
    return new DemoComparison(folder);
  }

  /** Address of the report. */
  get url(): string {
    return pathToFileURL(join(this.folder, 'report.html')).href;
  }

  close(): Promise<void> {
    return rm(this.folder, { recursive: true });
  }
}
