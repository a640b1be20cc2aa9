import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import type { Capture } from '../../src/capture';
import { seriousFindings } from './harness/axe';
import { openPage, slow, type Watched } from './harness/browser';
import type { TestClient } from './harness/client';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';
import { dropOnViewer, inViewer, whenShown } from './harness/viewing';
import { parseNpy } from './npy';

const capture = new SphereCapture();

describe.skipIf(missing)('a session as a capture', { timeout: 60_000 }, () => {
  let site: Site;
  let client: TestClient;

  beforeAll(async () => {
    site = await Site.start();
    client = site.client();
  }, 120_000);

  // A test that fails while the network is lost leaves it to the next one.
  afterEach(() => site.server.recover());

  beforeEach(() => site.service.run());

  afterAll(() => site.close());

  test('a_running_session_is_followed_frame_by_frame_until_its_container', async () => {
    const { id } = await client.create(capture, { name: 'live' });
    const ready = await client.whenReady(id);
    await client.post(id, capture, 0, 5);
    const watched = await openPage(site.browser, site.server.parts);
    await opened(watched, id);
    const opening = await state(watched);
    expect(opening).toMatchObject({ frames: 5, complete: false, problem: null, points: capture.points });
    expect(opening.cage).toBe(3 * ready.cage_vertices!);

    await client.post(id, capture, 5, 20);
    await eventually(watched, 'frames', 25);
    // The first frames were solved before the page came; it fetches them when they are looked at.
    for (const frame of [0, 4, 5, 24]) {
      expect(await cage(watched, frame)).toEqual(await solvedCage(client, id, frame));
    }
    await expect.poll(() => state(watched)).toMatchObject({ measured: 25 });
    const followed = await state(watched);
    expect(followed.live).toMatchObject({ state: 'following', droppedFrames: 0, behindFrames: 0 });
    await expect.poll(async () => (await state(watched)).live!.latencySeconds, { timeout: 8000 }).toBeLessThan(2);
    expect(followed.live!.bitsPerSecond).toBeGreaterThan(0);

    await client.complete(id, 25);
    await eventually(watched, 'complete', true);
    const finished = await state(watched);
    expect(finished).toMatchObject({ frames: 25, problem: null, measured: 25 });
    expect(finished.live!.state).toBe('ended');
    expect(await watched.page.evaluate(() => window.parts.capture!.frameBytes)).toBeGreaterThan(0);
    expect(await cage(watched, 7)).toEqual(await solvedCage(client, id, 7));
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('a_frame_that_is_still_to_come_is_waited_for', async () => {
    const { id } = await client.create(capture, { name: 'awaited' });
    await client.whenReady(id);
    const watched = await openPage(site.browser, site.server.parts);
    await opened(watched, id);
    const awaited = cage(watched, 2);
    await expect.poll(async () => (await state(watched)).live!.lateFrames).toBe(1);
    await client.post(id, capture, 0, 3);
    expect(await awaited).toEqual(await solvedCage(client, id, 2));
    await watched.close();
  });

  test('a_service_that_is_killed_and_restarted_is_followed_on', async () => {
    const { id } = await client.create(capture, { name: 'restarted' });
    await client.whenReady(id);
    await client.post(id, capture, 0, 4);
    const watched = await openPage(site.browser, site.server.parts, ['502', 'ERR_']);
    await opened(watched, id);
    await site.service.kill();
    await expect.poll(async () => (await state(watched)).live!.state).toBe('reconnecting');
    expect((await state(watched)).problem).toMatch(/service/);
    await site.service.run();
    await client.post(id, capture, 4, 10);
    await eventually(watched, 'frames', 14);
    expect(await state(watched)).toMatchObject({ problem: null, complete: false });
    expect(await cage(watched, 13)).toEqual(await solvedCage(client, id, 13));
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('a_network_that_is_lost_without_a_word_is_noticed_and_followed_on_when_it_is_back', async () => {
    const { id } = await client.create(capture, { name: 'lost' });
    await client.whenReady(id);
    const watched = await openPage(site.browser, site.server.parts);
    await opened(watched, id);
    await client.post(id, capture, 0, 2);
    await eventually(watched, 'frames', 2);
    site.server.stall();
    await client.post(id, capture, 2, 5);
    await expect.poll(async () => (await state(watched)).problem, { timeout: 20_000 }).toMatch(/Cannot reach/);
    expect((await state(watched)).frames).toBe(2);
    site.server.recover();
    await expect.poll(async () => (await state(watched)).frames, { timeout: 30_000 }).toBe(7);
    expect(await state(watched)).toMatchObject({ problem: null, complete: false });
    await watched.close();
  });

  test('a_session_whose_frames_are_coded_is_followed_and_ends_with_its_residual', async () => {
    const red = { cage: capture.cage, rest: capture.rest.replace(/^v .*$/gm, '$& 1 0 0.2') };
    const { id } = await client.create(red, { name: 'coded', max_error: 1e-3 });
    await client.whenReady(id);
    await client.post(id, capture, 0, 6);
    const watched = await openPage(site.browser, site.server.parts);
    await opened(watched, id);
    const colors = await watched.page.evaluate(() => [...window.parts.capture!.static.colors!.slice(0, 6)]);
    expect(colors).toEqual([255, 0, 51, 255, 0, 51]);
    await client.post(id, capture, 6, 6);
    await eventually(watched, 'frames', 12);
    await client.complete(id, 12);
    await eventually(watched, 'complete', true);
    const largest = await watched.page.evaluate(async () => {
      const { errors, block } = window.parts.capture!;
      const first = await block.call(window.parts.capture, 0);
      return { residual: first.residual !== null, worst: Math.max(...errors.linf) };
    });
    expect(largest.residual).toBe(true);
    expect(largest.worst).toBeLessThanOrEqual(1e-3);
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('a_session_that_is_deleted_while_it_is_watched_says_so_and_keeps_its_frames', async () => {
    const { id } = await client.create(capture, { name: 'deleted' });
    await client.whenReady(id);
    // The stream of frames breaks off.
    const watched = await openPage(site.browser, site.server.parts, ['404', '410', 'ERR_INCOMPLETE_CHUNKED_ENCODING']);
    await opened(watched, id);
    await client.post(id, capture, 0, 3);
    await eventually(watched, 'frames', 3);
    await client.call(`/${id}`, { method: 'DELETE' });
    await eventually(watched, 'complete', true);
    expect((await state(watched)).problem).toMatch(/deleted/);
    expect((await cage(watched, 1)).length).toBeGreaterThan(0);
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('a_slow_connection_stays_at_the_newest_frame_and_fetches_the_others_when_they_are_looked_at', async () => {
    const { id } = await client.create(capture, { name: 'slow' });
    await client.whenReady(id);
    const watched = await openPage(site.browser, site.server.parts);
    await slow(watched.page, { downloadThroughput: 10_000 });
    await opened(watched, id);
    // As from a farm that solves two hundred frames in a second: 100 kB/s.
    for (let first = 0; first < 400; first += 50) {
      await client.post(id, capture, first, 50);
      await watched.page.waitForTimeout(250);
    }
    await eventually(watched, 'frames', 400);
    expect((await state(watched)).live!.droppedFrames).toBeGreaterThan(100);
    await slow(watched.page, {});
    expect(await cage(watched, 350)).toEqual(await solvedCage(client, id, 350));
    await expect.poll(async () => (await state(watched)).measured, { timeout: 15_000 }).toBe(400);
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('the_viewer_follows_a_session_that_is_being_uploaded', async () => {
    const { id } = await client.create(capture, { name: 'watched' });
    await client.whenReady(id);
    await client.post(id, capture, 0, 4);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/session/${id}`);
    const frames = () =>
      page.locator('cager-viewer').evaluate((viewer) => (viewer as unknown as { capture: Capture }).capture.frames);
    await expect.poll(frames, { timeout: 20_000 }).toBe(4);
    await client.post(id, capture, 4, 8);
    await expect.poll(frames).toBe(12);
    const badge = page.getByText(/^(LIVE|Go live|Waiting for frames)$/);
    await badge.waitFor();
    await client.complete(id, 12);
    await expect.poll(() => badge.count()).toBe(0);
    expect(errors).toEqual([]);
    await close();
  });

  test('the_page_is_live_only_while_the_service_answers_and_a_dropped_file_leaves_the_session', async () => {
    const { id } = await client.create(capture, { name: 'dead' });
    await client.whenReady(id);
    await client.post(id, capture, 0, 20);
    const { page, close } = await openPage(site.browser, `${site.page}#/session/${id}`, ['ERR_', '502']);
    await whenShown(page);
    const transport = () => inViewer(page, (viewer) => viewer.player!.transport, null);
    if (!(await transport()).playing) await page.keyboard.press('Space');
    await page.getByText('Waiting for frames').waitFor();
    // The picture stays at the newest frames, of which 60 come at once, until somebody pauses.
    await client.post(id, capture, 20, 60);
    await page.getByText('LIVE', { exact: true }).waitFor();
    await expect.poll(async () => (await transport()).position).toBeGreaterThan(60);
    await page.keyboard.press('Space');
    await client.post(id, capture, 80, 60);
    await page.getByRole('button', { name: 'Go live' }).click();
    await page.getByText('LIVE', { exact: true }).waitFor();
    await client.post(id, capture, 150, 5);
    await page.getByText('Waiting for frame 140').waitFor({ timeout: 20_000 });
    await client.post(id, capture, 140, 10);
    await page.getByText('LIVE', { exact: true }).waitFor();
    await site.service.kill();
    await page.getByText(/^Reconnecting/).waitFor({ timeout: 20_000 });
    expect(await page.getByText('LIVE', { exact: true }).count()).toBe(0);
    await dropOnViewer(page, { 'holiday.cager': Buffer.from('a picture of a beach') });
    expect(await page.evaluate(() => location.hash)).toContain(id);
    const file = await readFile(new URL('../../../tests/golden/definition3-mvc.cager', import.meta.url));
    await dropOnViewer(page, { 'walk.cager': file });
    await page.getByRole('button', { name: 'Replace current' }).click();
    await page.getByRole('img', { name: /^walk\.cager: 3D view/ }).waitFor({ timeout: 20_000 });
    expect(await page.evaluate(() => location.hash)).toMatch(/^#\/file/);
    await site.service.run();
    await page.goBack();
    await page.getByRole('img', { name: /^dead: 3D view/ }).waitFor({ timeout: 20_000 });
    await close();
  });

  test('coordinates_go_on_where_they_broke_off', async () => {
    const { id } = await client.create(new SphereCapture(4), { name: 'harmonic', coordinates: 'harmonic' });
    await client.whenReady(id);
    const watched = await openPage(site.browser, site.server.parts, ['ERR_', '502']);
    site.server.stopNext = { path: '/coordinates', bytes: 100_000 };
    const ranges: (string | undefined)[] = [];
    watched.page.on('request', (request) => ranges.push(request.headers().range));
    const heard: number[] = [];
    await watched.page.exposeFunction('hear', (part: number) => heard.push(part));
    const received = watched.page.evaluate(async (session) => {
      const { hear } = window as unknown as { hear: (part: number) => void };
      const { rows, columns, values } = await new window.parts.Service().coordinates(session, hear);
      return { rows, columns, values: [...values] };
    }, id);
    // A connection that breaks takes with it what the page has not read yet.
    await expect.poll(() => heard.at(-1)).toBe(100_000 / (4 * 2562 * 42));
    site.server.breakOff();
    const { rows, columns, values } = await received;
    expect([rows, columns]).toEqual([2562, 42]);
    const there = new Float32Array(await (await client.call(`/${id}/coordinates`)).arrayBuffer());
    expect(values).toEqual([...there]);
    expect(ranges.at(-1)).toBe('bytes=100000-');
    expect(heard.every((part, k) => k === 0 || part > heard[k - 1])).toBe(true);
    await expect.poll(() => heard.at(-1)).toBe(1);
    await watched.close();
  });

  test('a_finished_session_of_coded_frames_and_harmonic_coordinates_is_decoded_with_what_the_service_computed', async () => {
    const id = await client.encode(capture, { name: 'coded harmonic', coordinates: 'harmonic', max_error: 1e-3 }, 10);
    const watched = await openPage(site.browser, site.server.parts);
    await opened(watched, id);
    const there = parseNpy(await decodedCages(client, id));
    const size = Math.max(...there.values);
    for (const frame of [0, 9]) {
      const expected = there.values.subarray(frame * 3 * there.shape[1], (frame + 1) * 3 * there.shape[1]);
      const here = await cage(watched, frame);
      expect(here).toHaveLength(expected.length);
      const off = here.map((value, k) => Math.abs(value - expected[k]) / size);
      expect(Math.max(...off)).toBeLessThan(1e-5);
    }
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('a_session_that_failed_says_why', async () => {
    const { id } = await client.create(capture, { name: 'failed' });
    await client.whenReady(id);
    await client.post(id, capture, 0, 2);
    await site.service.restartWithDamage(id);
    expect((await client.session(id)).state).toBe('failed');
    const watched = await openPage(site.browser, site.server.parts);
    const refused = opened(watched, id).then(
      () => '',
      (error: unknown) => String(error),
    );
    expect(await refused).toMatch(/damaged/);
    await watched.close();
  });

  test('a_session_whose_container_is_lost_is_opened_and_followed_until_it_is_completed_again', async () => {
    const id = await client.encode(capture, { name: 'lost container' }, 6);
    await site.service.loseContainer(id);
    await expect(client.call(`/${id}/capture.cager`)).rejects.toThrow(/^503/);
    const { state: now, problem } = await client.session(id);
    expect([now, problem?.status]).toEqual(['ready', 503]);
    const watched = await openPage(site.browser, site.server.parts);
    await opened(watched, id);
    await expect.poll(async () => (await state(watched)).live!.state).toBe('following');
    expect(await state(watched)).toMatchObject({ frames: 6, complete: false, problem: null });
    expect(await cage(watched, 5)).toEqual(await solvedCage(client, id, 5));
    await client.complete(id, 6);
    await eventually(watched, 'complete', true);
    expect(await state(watched)).toMatchObject({ frames: 6, problem: null, measured: 6 });
    expect(watched.errors).toEqual([]);
    await watched.close();
  });
});

describe.skipIf(missing)('a session behind tokens', { timeout: 60_000 }, () => {
  const tokens = ['the-first-token-of-studio-a-for-tests', 'the-second-token-of-studio-a-for-tests'];
  let site: Site;

  beforeAll(async () => {
    site = await Site.start({ 'studio-a': tokens[0] });
  }, 120_000);

  afterAll(() => site.close());

  test('a_token_that_ends_while_a_session_is_followed_is_asked_for_anew', async () => {
    const { id } = await site.client(tokens[0]).create(capture, { name: 'guarded' });
    await site.client(tokens[0]).whenReady(id);
    await site.client(tokens[0]).post(id, capture, 0, 3);
    const watched = await openPage(site.browser, site.server.parts, ['401', 'ERR_']);
    const signIn = (token: string) => watched.page.evaluate((given) => window.parts.pageToken.set(given, false), token);
    await signIn(tokens[0]);
    await opened(watched, id);
    await site.service.setTokens({ 'studio-a': tokens[1] });
    await expect.poll(async () => (await state(watched)).live!.state, { timeout: 15_000 }).toBe('signed-out');
    expect((await state(watched)).problem).toMatch(/Sign in with an access token/);
    await site.client(tokens[1]).post(id, capture, 3, 4);
    await signIn(tokens[1]);
    await eventually(watched, 'frames', 7);
    expect(await state(watched)).toMatchObject({ problem: null, measured: 7 });
    expect(watched.errors).toEqual([]);
    await watched.close();
  });

  test('the_page_asks_for_a_token_over_what_is_watched_and_goes_on_with_it', async () => {
    await site.service.setTokens({ 'studio-a': tokens[0] });
    const client = site.client(tokens[0]);
    await expect
      .poll(() =>
        client.call('').then(
          () => true,
          () => false,
        ),
      )
      .toBe(true);
    const { id } = await client.create(capture, { name: 'watched' });
    await client.whenReady(id);
    await client.post(id, capture, 0, 3);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/session/${id}`, ['401', 'ERR_']);
    const signIn = async (token: string) => {
      await page.getByLabel('Access token').fill(token);
      await page.keyboard.press('Enter');
    };
    const frames = () =>
      page.locator('cager-viewer').evaluate((viewer) => (viewer as unknown as { capture: Capture }).capture.frames);
    await signIn(tokens[0]);
    await expect.poll(frames, { timeout: 20_000 }).toBe(3);
    await page.locator('cager-viewer').evaluate((viewer) => (viewer.id = 'the same'));
    await site.service.setTokens({ 'studio-a': tokens[1] });
    await page.getByRole('dialog', { name: 'Sign in' }).waitFor({ timeout: 15_000 });
    expect(await seriousFindings(page)).toEqual([]);
    await site.client(tokens[1]).post(id, capture, 3, 4);
    await signIn(tokens[1]);
    await expect.poll(frames, { timeout: 20_000 }).toBe(7);
    expect(await page.getByRole('dialog').count()).toBe(0);
    expect(await page.locator('cager-viewer').getAttribute('id')).toBe('the same');
    expect(errors).toEqual([]);
    await close();
  });
});

/** The cages of a session's container, as the program decodes them. */
async function decodedCages(client: TestClient, id: string): Promise<Uint8Array> {
  const folder = await mkdtemp(join(tmpdir(), 'cager-web-'));
  try {
    const [file, cages] = [join(folder, 'capture.cager'), join(folder, 'cages.npy')];
    await writeFile(file, Buffer.from(await (await client.call(`/${id}/capture.cager`)).arrayBuffer()));
    execFileSync(cager!, ['decode', file, '--cages', '-o', cages, '--quiet'], { stdio: 'pipe' });
    return await readFile(cages);
  } finally {
    await rm(folder, { recursive: true });
  }
}

async function opened({ page }: Watched, id: string): Promise<void> {
  await page.evaluate(async (session) => {
    window.parts.capture = await window.parts.openSession(session);
  }, id);
}

/** What the page knows of its capture. */
async function state({ page }: Watched) {
  return page.evaluate(() => {
    const capture = window.parts.capture as Awaited<ReturnType<typeof window.parts.openSession>>;
    const { frames, complete, problem, live } = capture;
    return {
      frames,
      complete,
      problem,
      live,
      points: capture.static.rest.length / 3,
      cage: capture.static.cage.positions.length,
      measured: [...capture.errors.l2].filter((error) => !Number.isNaN(error)).length,
    };
  });
}

async function eventually(watched: Watched, key: 'frames' | 'complete', value: unknown): Promise<void> {
  await expect.poll(async () => (await state(watched))[key], { timeout: 20_000 }).toBe(value);
}

/** The solved cage of a frame, as the page has it. */
async function cage({ page }: Watched, frame: number): Promise<number[]> {
  return page.evaluate(async (wanted) => {
    const block = await window.parts.capture!.block(wanted);
    const stride = block.cages.length / block.count;
    return [...block.cages.subarray((wanted - block.first) * stride, (wanted - block.first + 1) * stride)];
  }, frame);
}

/** The same as the service has it. */
async function solvedCage(client: TestClient, id: string, frame: number): Promise<number[]> {
  const bytes = await (await client.call(`/${id}/cages?first=${frame}&count=1`)).arrayBuffer();
  return [...new Float32Array(bytes)];
}
