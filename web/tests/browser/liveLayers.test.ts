import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { openPage } from './harness/browser';
import type { TestClient } from './harness/client';
import { NoisyCapture } from './harness/noisyCapture';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

/** Most that a point may be off, in diagonals. */
const MAX_ERROR = 5e-5;
/** Frames of a group of this capture, as the service says. */
const GROUP = 256;
/** What opening a completed session's container reads of its ends. */
const ENDS_BYTES = (1 << 16) + (1 << 13);

const capture = new NoisyCapture(2);

describe.skipIf(missing)('layers of a running session', { timeout: 120_000 }, () => {
  let site: Site;
  let client: TestClient;

  beforeAll(async () => {
    site = await Site.start();
    client = site.client();
  }, 120_000);

  afterAll(() => site.close());

  test('a closed group is shown as it was coded, and an open one by its cages', async () => {
    const id = await started('followed', 20);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/session/${id}`);
    const received = await containerBytes(page);
    await whenShown(page);
    await stand(page, 10);
    const diagonal = await inViewer(page, ({ player }) => player!.stage.decoder.diagonal, null);
    const off = (here: ArrayLike<number>, there: ArrayLike<number>) => farthest(here, there) / diagonal;

    const cages = await fromCages(client, id, 10);
    await expect.poll(async () => off(await shown(page), cages)).toBeLessThan(1e-5);
    await post(id, 20, GROUP + 24);
    // The picture that stands gets its residual as soon as that is there.
    await expect
      .poll(async () => off(await shown(page), capture.frames(10, 1)), { timeout: 30_000 })
      .toBeLessThan(MAX_ERROR);
    const closed = [0, 10, 100, GROUP - 1];
    const live: number[][] = [];
    for (const frame of closed) live.push(await positions(page, frame));
    closed.forEach((frame, k) => expect(off(live[k], capture.frames(frame, 1))).toBeLessThan(MAX_ERROR));
    const open = await positions(page, GROUP + 4);
    expect(off(open, await fromCages(client, id, GROUP + 4))).toBeLessThan(1e-5);
    expect(off(open, capture.frames(GROUP + 4, 1))).toBeGreaterThan(MAX_ERROR);
    expect(await inViewer(page, ({ player }) => player!.capture.complete, null)).toBe(false);

    await client.complete(id, GROUP + 24);
    await expect.poll(() => inViewer(page, ({ player }) => player!.capture.complete, null)).toBe(true);
    const { file, decoded } = await decodedContainer(client, id);
    closed.forEach((frame, k) => expect(off(live[k], decoded(frame))).toBeLessThan(1e-5));
    for (const frame of [...closed, GROUP + 4]) {
      const here = await positions(page, frame);
      expect(off(here, decoded(frame))).toBeLessThan(1e-5);
      expect(off(here, capture.frames(frame, 1))).toBeLessThan(MAX_ERROR);
    }
    // What came while the session ran is not fetched again: that would be more than the ends are.
    expect(file).toBeGreaterThan(ENDS_BYTES);
    expect(received()).toBeLessThanOrEqual(file + ENDS_BYTES);
    expect(errors).toEqual([]);
    await close();
  });

  test('a group comes over a broken connection', async () => {
    const id = await started('broken', GROUP + 4);
    await expect.poll(async () => (await client.session(id)).coding!.frames, { timeout: 30_000 }).toBe(GROUP);
    const whole = (await (await client.call(`/${id}/capture.cager`)).arrayBuffer()).byteLength;
    site.server.stopNext = { path: '/capture.cager', bytes: whole / 2 };
    const { page, close } = await openPage(site.browser, `${site.page}#/session/${id}`, ['ERR_']);
    const received = await containerBytes(page);
    await whenShown(page);
    await expect.poll(received).toBeGreaterThan(whole / 2 - 1);
    expect(await isFinal(page, 10)).toBe(false);
    expect(await positions(page, 10)).toHaveLength(3 * capture.points);
    site.server.breakOff();
    await expect.poll(() => isFinal(page, 10), { timeout: 20_000 }).toBe(true);
    const diagonal = await inViewer(page, ({ player }) => player!.stage.decoder.diagonal, null);
    expect(farthest(await positions(page, 10), capture.frames(10, 1)) / diagonal).toBeLessThan(MAX_ERROR);
    expect(received()).toBeLessThan(1.5 * whole + 1000);
    await close();
  });

  /** A session whose first frames are posted. */
  async function started(name: string, frames: number): Promise<string> {
    const { id } = await client.create(capture, { name, max_error: MAX_ERROR });
    expect((await client.whenReady(id)).coding!.group_frames).toBe(GROUP);
    await post(id, 0, frames);
    return id;
  }

  /** Posts frames in parts. */
  async function post(id: string, first: number, end: number): Promise<void> {
    for (let at = first; at < end; at += 50) await client.post(id, capture, at, Math.min(50, end - at));
  }
});

/** Bytes of containers that the page has received from now on. */
async function containerBytes(page: Page): Promise<() => number> {
  const session = await page.context().newCDPSession(page);
  await session.send('Network.enable');
  const asked = new Set<string>();
  let bytes = 0;
  session.on('Network.requestWillBeSent', ({ requestId, request }) => {
    if (request.url.includes('/capture.cager')) asked.add(requestId);
  });
  session.on('Network.dataReceived', ({ requestId, dataLength }) => {
    if (asked.has(requestId)) bytes += dataLength;
  });
  return () => bytes;
}

/** Has the viewer stand at a frame. */
async function stand(page: Page, frame: number): Promise<void> {
  await inViewer(
    page,
    ({ player }, position) => void (player!.transport = { ...player!.transport, playing: false, position }),
    frame,
  );
}

function isFinal(page: Page, frame: number): Promise<boolean> {
  return inViewer(page, ({ player }, wanted) => player!.capture.hasFinal!(wanted), frame);
}

/** Positions of the picture that is shown. */
function shown(page: Page): Promise<number[]> {
  return inViewer(page, ({ player }) => [...player!.stage.decoder.readPositions()], null);
}

/** Positions of a frame as the graphics processor decodes them. */
function positions(page: Page, frame: number): Promise<number[]> {
  return inViewer(page, async ({ player }, wanted) => [...(await player!.readPositions(wanted))], frame);
}

/** Positions that the service decodes a frame's solved cage to. */
async function fromCages(client: TestClient, id: string, frame: number): Promise<Float32Array> {
  const body = await (await client.call(`/${id}/cages?first=${frame}&count=1`)).arrayBuffer();
  const headers = { 'Content-Type': 'application/octet-stream' };
  return new Float32Array(await (await client.call(`/${id}/decode`, { method: 'POST', headers, body })).arrayBuffer());
}

/** Size of a session's container, and positions of its frames as the program decodes them. */
async function decodedContainer(client: TestClient, id: string) {
  const folder = await mkdtemp(join(tmpdir(), 'cager-web-'));
  try {
    const [file, out] = [join(folder, 'capture.cager'), join(folder, 'frames.npy')];
    const bytes = Buffer.from(await (await client.call(`/${id}/capture.cager`)).arrayBuffer());
    await writeFile(file, bytes);
    execFileSync(cager!, ['decode', file, '-o', out, '--quiet'], { stdio: 'pipe' });
    const { values } = parseNpy(await readFile(out));
    const width = 3 * capture.points;
    const decoded = (frame: number) => values.subarray(frame * width, (frame + 1) * width);
    return { file: bytes.length, decoded };
  } finally {
    await rm(folder, { recursive: true });
  }
}

/** The largest distance between points of the same number. */
function farthest(here: ArrayLike<number>, there: ArrayLike<number>): number {
  expect(here.length).toBe(there.length);
  let most = 0;
  for (let k = 0; k < here.length; k += 3) {
    most = Math.max(most, Math.hypot(here[k] - there[k], here[k + 1] - there[k + 1], here[k + 2] - there[k + 2]));
  }
  return most;
}
