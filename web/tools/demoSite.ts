/** The built-in demo capture in a service that runs on this machine, and the service's page behind a meter. */

import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { parseNpy } from '../tests/browser/npy';
import { cager, missing } from '../tests/browser/harness/programs';
import { TestService } from '../tests/browser/harness/service';
import { Meter } from './meter';

/** Frames that are sent at once. */
const FRAMES_AT_ONCE = 12;

/** What `cager demo` writes: meshes as text, and positions of all frames. */
export interface Demo {
  readonly rest: string;
  readonly cage: string;
  readonly shape: readonly number[];
  readonly frames: Float32Array;
}

export class DemoSite {
  private constructor(
    private readonly service: TestService,
    readonly demo: Demo,
    readonly meter: Meter,
  ) {}

  static async start(): Promise<DemoSite> {
    if (missing) throw new Error(`The page cannot be opened: ${missing}.`);
    const demo = await demoCapture();
    const service = await TestService.start();
    return new DemoSite(service, demo, await Meter.start(service.origin));
  }

  /** Address of the page, through the meter. */
  get page(): string {
    return this.meter.base;
  }

  get points(): number {
    return this.demo.shape[1];
  }

  /** A session of the first `frames` frames, of all where nothing is said; `isComplete` says whether more are to come. */
  async session(name: string, frames = this.demo.shape[0], isComplete = true): Promise<string> {
    const body = new FormData();
    body.append('options', JSON.stringify({ name, frame_rate: 30 }));
    body.append('rest', new Blob([this.demo.rest]), 'rest.obj');
    body.append('cage', new Blob([this.demo.cage]), 'cage.obj');
    const { id } = (await (await this.call('', { method: 'POST', body })).json()) as { id: string };
    while (((await (await this.call(`/${id}`)).json()) as { state: string }).state === 'preparing') {
      await new Promise((resolve) => setTimeout(resolve, 100));
    }
    const length = 3 * this.points;
    for (let first = 0; first < frames; first += FRAMES_AT_ONCE) {
      const sent = this.demo.frames.slice(length * first, length * Math.min(frames, first + FRAMES_AT_ONCE));
      const headers = { 'Content-Type': 'application/octet-stream' };
      await (await this.call(`/${id}/frames?first=${first}`, { method: 'POST', headers, body: sent })).text();
    }
    if (isComplete) {
      const headers = { 'Content-Type': 'application/json' };
      await this.call(`/${id}/complete`, { method: 'POST', headers, body: JSON.stringify({ frames }) });
    }
    return id;
  }

  /** The container of a session. */
  async container(id: string): Promise<Uint8Array> {
    return new Uint8Array(await (await this.call(`/${id}/capture.cager`)).arrayBuffer());
  }

  async close(): Promise<void> {
    this.meter.close();
    await this.service.close();
  }

  private async call(path: string, init: RequestInit = {}): Promise<Response> {
    const response = await fetch(`${this.service.origin}/v1/sessions${path}`, init);
    if (!response.ok) throw new Error(`${response.status} ${await response.text()}`);
    return response;
  }
}

async function demoCapture(): Promise<Demo> {
  const folder = await mkdtemp(join(tmpdir(), 'cager-demo-'));
  try {
    execFileSync(cager!, ['demo', '--quiet', '--output', join(folder, 'demo')], {
      stdio: ['ignore', 'ignore', 'inherit'],
    });
    const file = (name: string) => join(folder, 'demo', name);
    const { shape, values } = parseNpy(await readFile(file('decoded.npy')));
    const [rest, cage] = [await readFile(file('rest.obj'), 'utf8'), await readFile(file('cage.obj'), 'utf8')];
    return { rest, cage, shape, frames: rippled(values, shape[1]) };
  } finally {
    await rm(folder, { recursive: true });
  }
}

/** Decoded frames fit their cage exactly: a ripple that is finer than it gives them errors such as captures have. */
function rippled(values: ArrayLike<number>, points: number): Float32Array {
  return Float32Array.from(values, (value, at) => {
    const frame = Math.floor(at / (3 * points));
    const phase = 60 * values[at - (at % 3)] + 45 * values[at - (at % 3) + 1];
    return value * (1 + 4e-3 * Math.sin(phase) * Math.sin(frame / 9));
  });
}
