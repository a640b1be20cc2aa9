import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import { solvedFromStart } from '../../src/service/messages';
import { seriousFindings } from './harness/axe';
import { openPage } from './harness/browser';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';

const capture = new SphereCapture();
const small = new SphereCapture(2);
const FRAMES = 12;
/** A capture that takes several requests; its frames are repeated behind each other. */
const large = new SphereCapture(4);
const LARGE = { 'rest.obj': large.rest, 'cage.obj': large.cage, 'wave.npy': large.npy(4) };
const LARGE_FRAMES = 80;

describe.skipIf(missing)('an upload', { timeout: 120_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start();
  }, 120_000);

  beforeEach(() => site.service.run());
  afterEach(() => site.server.release());

  afterAll(() => site.close());

  test('what_is_dropped_is_encoded_so_that_nobody_sees_a_difference', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`);
    expect(await seriousFindings(page)).toEqual([]);
    await drop(page, { 'rest.obj': capture.rest, 'cage.obj': capture.cage, 'wave.npy': capture.npy(FRAMES) });
    await page.getByText(`${FRAMES} frames of 642 points`).waitFor();
    expect(await roles(page)).toEqual({ 'rest.obj': 'rest', 'wave.npy': 'frames', 'cage.obj': 'cage' });
    expect(await page.getByLabel('Name').inputValue()).toBe('wave');
    expect(await seriousFindings(page)).toEqual([]);
    await page.getByRole('button', { name: 'Encode' }).click();
    const id = await encoded(page);
    // The errors of the file, not those of its cages alone.
    const chart = page.getByRole('img', { name: /^Errors of the frames/ });
    expect(await chart.getAttribute('aria-label')).toMatch(/worst point 0\.(0\d+|1) % of the diagonal$/);
    expect(await seriousFindings(page)).toEqual([]);
    expect(errors).toEqual([]);
    await close();

    const measured = decodedErrors(Buffer.from(await (await site.client().call(`/${id}/capture.cager`)).arrayBuffer()));
    expect(Math.max(...measured.map(({ linf }) => linf))).toBeLessThanOrEqual(0.001);
  });

  test('a_mesh_per_frame_without_rest_pose_or_cage_is_enough', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`);
    const files = Object.fromEntries([8, 9, 10, 11].map((frame) => [`shot_${frame}.obj`, small.frameObj(frame)]));
    await drop(page, files);
    await page.getByText('The first frame, shot_8.obj, is used as the rest pose.').waitFor();
    await page.getByText('A cage is created around the rest pose').waitFor();
    await encodeCages(page);
    const id = await encoded(page);
    expect((await site.client().session(id)).frames.solved).toBe(4);
    expect(errors).toEqual([]);
    await close();
  });

  test('frames_of_another_mesh_are_refused_before_anything_is_sent', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`);
    const before = await sessions(site);
    await drop(page, { 'rest.obj': small.rest, 'wave.npy': capture.npy(2) });
    await page.getByText(/wave\.npy has 642 points in each frame and the rest pose rest\.obj has 162 points/).waitFor();
    expect(await page.getByRole('button', { name: 'Encode' }).isDisabled()).toBe(true);
    expect(await sessions(site)).toBe(before);
    await close();
  });

  test('animations_that_the_page_does_not_read_are_named_with_the_command_that_does', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`);
    const json = Buffer.from(JSON.stringify({ asset: { version: '2.0' }, animations: [{}] }).padEnd(64));
    const head = Buffer.alloc(20);
    head.write('glTF');
    head.writeUInt32LE(2, 4);
    head.writeUInt32LE(20 + json.length, 8);
    head.writeUInt32LE(json.length, 12);
    head.write('JSON', 16);
    await drop(page, { 'walk.glb': Uint8Array.from(Buffer.concat([head, json])) });
    await page
      .getByRole('alert')
      .getByText(/^walk\.glb is animated\. The page reads .*“cager encode --server http:\S+\/captures”\.$/)
      .waitFor();
    await drop(page, { 'walk.abc': 'Ogawa' });
    await page
      .locator('.items .remark')
      .getByText(/^The page reads .*“cager encode --server http:/)
      .waitFor();
    await close();
  });

  test('arrays_that_cannot_be_read_are_refused_in_words', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`);
    const text = Buffer.from(capture.npy(2)).toString('latin1');
    const fortran = Buffer.from(text.replace('False,', 'True, '), 'latin1');
    await drop(page, { 'rest.obj': capture.rest, 'wave.npy': fortran });
    await page.getByText(/Fortran order.*ascontiguousarray/).waitFor();
    const integers = Buffer.from(text.replace('<f4', '<i4'), 'latin1');
    await drop(page, { 'wave.npy': integers });
    await page.getByText(/data type is <i4/).waitFor();
    await close();
  });

  test('a_service_that_is_killed_during_an_upload_gets_the_rest_when_it_is_back', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`, ['502', 'ERR_']);
    site.server.holdFrames(1);
    await dropLarge(page);
    await page.getByText(`${LARGE_FRAMES} frames of 2,562 points`).waitFor();
    await encodeCages(page);
    await page.getByText('You can watch while it uploads').waitFor();
    await site.service.kill();
    site.server.release();
    await page
      .getByRole('alert')
      .getByText(/Retrying in/)
      .waitFor();
    await site.service.run();
    await page.getByRole('button', { name: 'Retry now' }).click();
    const id = await encoded(page);
    expect((await site.client().session(id)).frames).toMatchObject({ solved: LARGE_FRAMES, missing: [] });
    expect(errors).toEqual([]);
    await close();
  });

  test('an_upload_goes_on_while_the_session_is_watched', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`);
    site.server.holdFrames(1);
    await dropLarge(page);
    await encodeCages(page);
    await page.getByRole('link', { name: 'Watch live' }).click();
    const id = /#\/session\/([0-9a-f]+)/.exec(page.url())![1];
    await page.locator('cager-viewer').waitFor();
    expect((await site.client().session(id)).state).toBe('ready');
    site.server.release();
    await expect.poll(async () => (await site.client().session(id)).state, { timeout: 30_000 }).toBe('completed');
    await page.goto(`${site.page}#/upload`);
    await page.getByRole('heading', { name: 'Encoded: wave' }).waitFor();
    expect(errors).toEqual([]);
    await close();
  });

  test('a_motion_designer_cache_is_encoded_as_the_same_numbers_in_numpys_format', async () => {
    const numbers = capture.frames(0, FRAMES);
    const mdd = Buffer.alloc(8 + 4 * FRAMES + 4 * numbers.length);
    mdd.writeInt32BE(FRAMES, 0);
    mdd.writeInt32BE(capture.points, 4);
    numbers.forEach((value, k) => mdd.writeFloatBE(value, 8 + 4 * FRAMES + 4 * k));
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`);
    await drop(page, { 'rest.obj': capture.rest, 'cage.obj': capture.cage, 'wave.mdd': Uint8Array.from(mdd) });
    await page.getByText(`${FRAMES} frames of 642 points`).waitFor();
    await encodeCages(page);
    const id = await encoded(page);
    const whole = await site.client().encode(capture, { name: 'whole' }, FRAMES);
    expect(await toldErrors(site, id)).toEqual(await toldErrors(site, whole));
    expect(errors).toEqual([]);
    await close();
  });

  test('a_cage_is_designed_from_the_motion_and_taken_by_the_session', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`, ['404']);
    await drop(page, { 'rest.obj': small.rest, 'wave.npy': small.npy(FRAMES) });
    await page.getByLabel('Cage', { exact: true }).selectOption('motion');
    await page.getByLabel('Maximum cage vertices').fill('40');
    await page.getByLabel('Design time limit, in seconds').fill('10');
    expect(await seriousFindings(page)).toEqual([]);
    await encodeCages(page);
    await page.getByRole('heading', { name: 'Designing the cage: wave' }).waitFor();
    await page.getByRole('button', { name: 'Stop' }).click();
    await page.getByRole('heading', { name: 'Stopped: wave' }).waitFor();
    expect(await designs(site)).toBe(0);
    await page.getByRole('button', { name: 'Start again' }).click();
    const id = await encoded(page);
    const session = await site.client().session(id);
    expect(session.cage_vertices).toBeLessThanOrEqual(40);
    // The session keeps the cage, and nothing else is left at the service.
    expect(await designs(site)).toBe(0);
    const made = await encodedAroundRest(site, 40);
    const mean = (errors: readonly FrameError[]) => errors.reduce((sum, { l2 }) => sum + l2, 0) / errors.length;
    expect(mean(await toldErrors(site, id))).toBeLessThan(mean(await toldErrors(site, made)));
    expect(errors).toEqual([]);
    await close();
  });

  test('a_design_goes_on_after_a_reload_and_its_best_cage_so_far_can_be_taken', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`, ['404']);
    page.on('dialog', (dialog) => void dialog.accept());
    // So large that its design takes ten seconds on a fast machine, of which this needs three.
    const dense = new SphereCapture(5);
    const files = { 'rest.obj': dense.rest, 'wave.npy': dense.npy(24) };
    await drop(page, files);
    await page.getByLabel('Cage', { exact: true }).selectOption('motion');
    await page.getByLabel('Maximum cage vertices').fill('1200');
    await encodeCages(page);
    await expect.poll(() => designs(site), { timeout: 20_000 }).toBe(1);
    await page.reload();
    await page.getByRole('heading', { name: 'Upload of “wave” was interrupted' }).waitFor();
    await drop(page, files);
    await page.getByRole('button', { name: 'Resume' }).click();
    await page.getByRole('button', { name: 'Use this cage' }).click({ timeout: 30_000 });
    const id = await encoded(page);
    expect((await site.client().session(id)).frames.solved).toBe(24);
    expect(await designs(site)).toBe(0);
    await close();
  });

  test('a_session_that_is_deleted_during_its_upload_is_told_of_and_started_again', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`, ['404', '410', 'ERR_']);
    site.server.holdFrames(1);
    await dropLarge(page);
    await page.getByLabel('Name').fill('to be deleted');
    await encodeCages(page);
    const link = page.getByRole('link', { name: 'Watch live' });
    await link.waitFor();
    const deleted = (await link.getAttribute('href'))!.replace('#/session/', '');
    await expect.poll(async () => (await site.client().session(deleted)).frames.solved).toBeGreaterThan(0);
    await site.client().call(`/${deleted}`, { method: 'DELETE' });
    site.server.release();
    await page
      .getByRole('alert')
      .getByText(/The session was deleted during the upload/)
      .waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await page.getByRole('button', { name: 'Start again' }).click();
    const id = await encoded(page);
    expect(id).not.toBe(deleted);
    expect((await site.client().session(id)).frames).toMatchObject({ solved: LARGE_FRAMES, missing: [] });
    await close();
  });

  test('an_upload_whose_container_was_lost_meanwhile_goes_on_and_completes_again', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`, ['ERR_']);
    await page.route('**/complete', (route) => route.abort());
    await drop(page, { 'rest.obj': capture.rest, 'cage.obj': capture.cage, 'wave.npy': capture.npy(FRAMES) });
    await page.getByText(`${FRAMES} frames of 642 points`).waitFor();
    await encodeCages(page);
    const link = page.getByRole('link', { name: 'Watch live' });
    await link.waitFor();
    const id = (await link.getAttribute('href'))!.replace('#/session/', '');
    await page.getByText(/Retrying in/).waitFor();
    await page.getByRole('button', { name: 'Stop' }).click();
    await site.client().complete(id, FRAMES);
    await site.service.loseContainer(id);
    await expect(site.client().call(`/${id}/capture.cager`)).rejects.toThrow(/^503/);
    expect(await site.client().session(id)).toMatchObject({ state: 'ready', problem: { status: 503 } });
    await page.unroute('**/complete');
    await page.getByRole('button', { name: 'Resume' }).click();
    expect(await encoded(page)).toBe(id);
    expect((await site.client().session(id)).state).toBe('completed');
    expect(errors).toEqual([]);
    await close();
  });

  test('an_upload_that_was_stopped_goes_on_or_is_deleted', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`);
    site.server.holdFrames(1);
    await dropLarge(page);
    await encodeCages(page);
    await page.getByText('You can watch while it uploads').waitFor();
    await page.getByRole('button', { name: 'Stop' }).click();
    await page.getByRole('heading', { name: /Stopped/ }).waitFor();
    // Nothing is live any more.
    expect(await page.locator('cager-upload .primary').allInnerTexts()).toEqual(['Resume']);
    expect(await page.getByRole('link', { name: 'Watch live' }).count()).toBe(0);
    await page.getByRole('button', { name: 'Resume' }).click();
    await page.getByText('You can watch while it uploads').waitFor();
    await page.getByRole('button', { name: 'Stop' }).click();
    const before = await sessions(site);
    await page.getByRole('button', { name: 'Delete upload' }).click();
    await page
      .getByRole('button', { name: 'Choose files' })
      .or(page.getByRole('button', { name: 'Add files' }))
      .waitFor();
    expect(await sessions(site)).toBe(before - 1);
    expect(errors).toEqual([]);
    await close();
  });
});

describe.skipIf(missing)('an upload that was broken off', { timeout: 120_000 }, () => {
  const TOKEN = 'a-token-for-tests-alone';
  const OTHER_TOKEN = 'another-token-for-tests-alone';
  let site: Site;

  beforeAll(async () => {
    site = await Site.start({ studio: TOKEN, neighbour: OTHER_TOKEN });
  }, 120_000);

  afterEach(() => site.server.release());

  afterAll(() => site.close());

  test('by_a_reload_goes_on_with_what_is_missing_when_the_same_files_are_dropped', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/upload`, ['401']);
    page.on('dialog', (dialog) => void dialog.accept());
    await signIn(page);
    site.server.holdFrames(1);
    await dropLarge(page);
    await page.getByLabel('Name').fill('broken off');
    await encodeCages(page);
    await page.getByText('You can watch while it uploads').waitFor();
    const list = async () =>
      ((await (await site.client(TOKEN).call('')).json()) as { sessions: { id: string; name: string }[] }).sessions;
    const [{ id }] = await list();
    await expect.poll(async () => (await site.client(TOKEN).session(id)).frames.solved).toBeGreaterThan(10);
    await page.reload();

    await page.getByRole('heading', { name: 'Upload of “broken off” was interrupted' }).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    const kept = await page.evaluate(() => JSON.stringify(Object.entries(localStorage)));
    expect(kept).toContain(id);
    expect(kept).not.toContain(TOKEN);
    await drop(page, { ...LARGE, 'wave.npy': large.npy(5) });
    await page.getByText(/The frames of the interrupted upload: wave\.npy \(.*\), not wave\.npy \(.*\)\./).waitFor();
    await dropLarge(page);
    await page.getByRole('heading', { name: 'Resume “broken off”?' }).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    // What was solved before is known by now, and is not sent again.
    const firstMissing = solvedFromStart((await site.client(TOKEN).session(id)).frames);
    const posted: number[] = [];
    page.on('request', (request) => {
      const first = /frames\?first=(\d+)/.exec(request.url());
      if (first) posted.push(Number(first[1]));
    });
    site.server.release();
    await page.getByRole('button', { name: 'Resume' }).click();
    expect(await encoded(page)).toBe(id);
    expect(Math.min(...posted)).toBe(firstMissing);
    expect((await site.client(TOKEN).session(id)).frames).toMatchObject({ solved: LARGE_FRAMES, missing: [] });
    expect((await list()).length).toBe(1);
    expect(await page.evaluate(() => Object.keys(localStorage))).toEqual([]);
    // All errors are shown, those that were measured before the reload too.
    await page.getByRole('img', { name: /^Errors of the frames/ }).waitFor();
    expect(errors).toEqual([]);
    await close();
  });

  async function signIn(tab: Page, token = TOKEN): Promise<void> {
    await tab.getByLabel('Access token').fill(token);
    await tab.keyboard.press('Enter');
    await tab.getByRole('heading', { name: 'Upload a capture' }).waitFor();
  }

  test('during_its_design_is_shown_to_those_alone_whose_design_it_is', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`, ['401', '404']);
    page.on('dialog', (dialog) => void dialog.accept());
    await signIn(page);
    await drop(page, { 'rest.obj': large.rest, 'wave.npy': large.npy(24) });
    await page.getByLabel('Cage', { exact: true }).selectOption('motion');
    await page.getByLabel('Maximum cage vertices').fill('300');
    await encodeCages(page);
    await expect
      .poll(() => page.evaluate(() => JSON.stringify(Object.entries(localStorage))))
      .toMatch(/\\"design\\":\\"/);
    const context = page.context();
    await page.close();
    const open = async (token: string) => {
      const tab = await context.newPage();
      await tab.goto(`${site.page}#/upload`);
      await signIn(tab, token);
      return tab;
    };
    const other = await open(OTHER_TOKEN);
    await other.waitForTimeout(500);
    expect(await other.getByRole('heading', { name: /was interrupted/ }).count()).toBe(0);
    const own = await open(TOKEN);
    await own.getByRole('heading', { name: 'Upload of “wave” was interrupted' }).waitFor();
    await own.getByRole('button', { name: 'Dismiss' }).click();
    await expect.poll(() => own.getByRole('heading', { name: /was interrupted/ }).count()).toBe(0);
    await close();
  });

  test('by_closing_the_page_can_be_deleted_from_another_one', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`, ['401']);
    page.on('dialog', (dialog) => void dialog.accept());
    await signIn(page);
    site.server.holdFrames(1);
    await dropLarge(page);
    await encodeCages(page);
    await page.getByText('You can watch while it uploads').waitFor();
    const other = await page.context().newPage();
    await other.goto(`${site.page}#/upload`);
    await signIn(other);
    // While a tab sends it, no other one offers to.
    await other.waitForTimeout(500);
    expect(await other.getByRole('heading', { name: /was interrupted/ }).count()).toBe(0);
    const before = (await (await site.client(TOKEN).call('')).json()) as { sessions: unknown[] };
    await page.close();
    await other.reload();
    await other.getByRole('heading', { name: 'Upload of “wave” was interrupted' }).waitFor();
    await other.getByRole('button', { name: 'Delete upload' }).click();
    await expect.poll(() => other.getByRole('heading', { name: /was interrupted/ }).count()).toBe(0);
    const after = (await (await site.client(TOKEN).call('')).json()) as { sessions: unknown[] };
    expect(after.sessions.length).toBe(before.sessions.length - 1);
    await close();
  });
});

describe.skipIf(missing)('an upload to a service with little room', { timeout: 120_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start({}, ['tenant_max_bytes=2 MiB']);
  }, 120_000);

  afterAll(() => site.close());

  test('a_full_quota_says_what_to_do_and_the_upload_can_go_on', async () => {
    const { id: other } = await site.client().create(small, { name: 'other' });
    await site.client().whenReady(other);
    await site.client().post(other, small, 0, 3000);
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`, ['507']);
    await drop(page, { 'rest.obj': small.rest, 'cage.obj': small.cage, 'wave.npy': small.npy(1000) });
    await encodeCages(page);
    await page
      .getByRole('alert')
      .getByText(/Delete sessions that are no longer needed/)
      .waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    // The page makes room itself, and the upload waits meanwhile.
    await page.getByRole('link', { name: 'All sessions' }).click();
    await page.getByRole('button', { name: 'Delete other' }).click();
    await page.getByRole('dialog').getByRole('button', { name: 'Delete', exact: true }).click();
    await expect.poll(() => page.getByRole('button', { name: 'Delete other' }).count()).toBe(0);
    await page.getByRole('link', { name: 'Back to upload' }).click();
    await page.getByRole('button', { name: 'Try again' }).click();
    const id = await encoded(page);
    expect((await site.client().session(id)).frames).toMatchObject({ solved: 1000, missing: [] });
    await close();
  });
});

describe.skipIf(missing)('an upload to a service with as many sessions as it takes', { timeout: 120_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start({}, ['tenant_max_sessions=1']);
  }, 120_000);

  afterAll(() => site.close());

  test('says_so_and_begins_by_itself_once_one_was_deleted', async () => {
    const { id: other } = await site.client().create(small, { name: 'other' });
    const { page, close } = await openPage(site.browser, `${site.page}#/upload`, ['429']);
    await drop(page, { 'rest.obj': small.rest, 'cage.obj': small.cage, 'wave.npy': small.npy(4) });
    await encodeCages(page);
    await page
      .getByRole('alert')
      .getByText(/Delete sessions that are no longer needed\. Retrying in \d+ s\./)
      .waitFor();
    await site.client().call(`/${other}`, { method: 'DELETE' });
    const id = await encoded(page);
    expect((await site.client().session(id)).frames.solved).toBe(4);
    await close();
  });
});

type Files = Readonly<Record<string, string | Uint8Array>>;

/** Drops files on the upload; the numbers of the array `repeated.name` are repeated behind each other, and its header says so. */
async function drop(page: Page, files: Files, repeated?: { name: string; times: number }): Promise<void> {
  const carried = Object.entries(files).map(
    ([name, content]) => [name, Buffer.from(content).toString('base64')] as const,
  );
  await page.locator('cager-upload main').evaluate(
    (zone, { carried, repeated }) => {
      const transfer = new DataTransfer();
      for (const [name, base64] of carried) {
        const bytes = Uint8Array.from(atob(base64), (sign) => sign.charCodeAt(0));
        let parts: Uint8Array<ArrayBuffer>[] = [bytes];
        if (name === repeated?.name) {
          const begin = 10 + new DataView(bytes.buffer).getUint16(8, true);
          const header = new TextDecoder('latin1').decode(bytes.subarray(10, begin));
          const frames = Number(/\((\d+),/.exec(header)![1]);
          const more =
            header
              .replace(`(${frames},`, `(${frames * repeated.times},`)
              .trimEnd()
              .padEnd(begin - 11) + '\n';
          parts = [bytes.subarray(0, 10), new TextEncoder().encode(more)];
          for (let k = 0; k < repeated.times; k += 1) parts.push(bytes.subarray(begin));
        }
        transfer.items.add(new File(parts, name));
      }
      zone.dispatchEvent(
        new DragEvent('dragover', { dataTransfer: transfer, bubbles: true, cancelable: true, composed: true }),
      );
      zone.dispatchEvent(
        new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true, composed: true }),
      );
    },
    { carried, repeated },
  );
}

/** Drops {@link LARGE}; the bytes are made in the page, as they are too many to be carried there. */
function dropLarge(page: Page): Promise<void> {
  return drop(page, LARGE, { name: 'wave.npy', times: LARGE_FRAMES / 4 });
}

/** Waits for the end of the upload; the session's identifier. */
async function encoded(page: Page): Promise<string> {
  const link = page.getByRole('link', { name: 'Open in viewer' });
  await link.waitFor({ timeout: 40_000 });
  return (await link.getAttribute('href'))!.replace('#/session/', '');
}

async function roles(page: Page): Promise<Record<string, string>> {
  const selects = page.locator('cager-upload .items select');
  return selects.evaluateAll((found) =>
    Object.fromEntries(
      (found as HTMLSelectElement[]).map((select) => [
        select.getAttribute('aria-label')!.replace(/^Role of /, ''),
        select.value,
      ]),
    ),
  );
}

async function sessions(site: Site): Promise<number> {
  return ((await (await site.client().call('')).json()) as { sessions: unknown[] }).sessions.length;
}

/** A completed session whose cage was made around the rest pose. */
async function encodedAroundRest(site: Site, vertices: number): Promise<string> {
  const client = site.client();
  const body = new FormData();
  body.append('options', JSON.stringify({ cage: { vertices } }));
  body.append('rest', new Blob([small.rest]), 'rest.obj');
  const { id } = (await (await client.call('', { method: 'POST', body })).json()) as { id: string };
  await client.whenReady(id);
  await client.post(id, small, 0, FRAMES);
  await client.complete(id, FRAMES);
  return id;
}

/** Designs of cages at the service. */
async function designs(site: Site): Promise<number> {
  const response = await fetch(`${site.service.origin}/v1/cages`);
  return ((await response.json()) as { cages: unknown[] }).cages.length;
}

interface FrameError {
  readonly l2: number;
  readonly linf: number;
}

/** Has cages alone encoded: fewer tests wait for the coding of frames. */
async function encodeCages(page: Page): Promise<void> {
  await page.getByLabel('Accuracy').selectOption('cages');
  await page.getByRole('button', { name: 'Encode' }).click();
}

async function toldErrors(site: Site, id: string): Promise<FrameError[]> {
  return ((await (await site.client().call(`/${id}/errors`)).json()) as { frames: FrameError[] }).frames;
}

/** Errors of what the program decodes from a container, as fractions of the rest pose's diagonal. */
function decodedErrors(container: Buffer): FrameError[] {
  const folder = mkdtempSync(join(tmpdir(), 'cager-web-'));
  try {
    writeFileSync(join(folder, 'capture.cager'), container);
    execFileSync(cager!, ['decode', join(folder, 'capture.cager'), '-o', join(folder, 'out.npy'), '--quiet']);
    const file = readFileSync(join(folder, 'out.npy'));
    const begin = 10 + file.readUInt16LE(8);
    const decoded = new Float32Array(file.buffer.slice(file.byteOffset + begin, file.byteOffset + file.length));
    const posted = capture.frames(0, FRAMES);
    const stride = 3 * capture.points;
    const diagonal = Math.hypot(2, 2, 2);
    return Array.from({ length: FRAMES }, (_, frame) => {
      let [sum, largest] = [0, 0];
      for (let i = frame * stride; i < (frame + 1) * stride; i += 3) {
        const square = [0, 1, 2].reduce((total, axis) => total + (decoded[i + axis] - posted[i + axis]) ** 2, 0);
        sum += square;
        largest = Math.max(largest, square);
      }
      return { l2: Math.sqrt(sum / capture.points) / diagonal, linf: Math.sqrt(largest) / diagonal };
    });
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}
