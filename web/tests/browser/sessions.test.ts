import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import { seriousFindings } from './harness/axe';
import { openPage, PHONE } from './harness/browser';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';

const capture = new SphereCapture();
const TOKEN_A = 'a-token-of-studio-a-for-tests-alone';
const TOKEN_B = 'a-token-of-studio-b-for-tests-alone';

describe.skipIf(missing)('the list of sessions', { timeout: 120_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start();
  }, 120_000);

  beforeEach(() => site.service.run());

  afterAll(() => site.close());

  test('an_empty_list_says_how_to_begin', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`);
    await page.getByRole('heading', { name: 'No sessions yet' }).waitFor();
    await page.getByText('cager encode --server').waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    expect(errors).toEqual([]);
    await close();
  });

  test('sessions_show_with_their_figures_and_go_on_by_themselves', async () => {
    const client = site.client();
    await client.encode(capture, { name: 'finished' }, 24);
    // With one that is not finished the page asks every two seconds.
    const { id } = await client.create(capture, { name: 'arriving' });
    await client.whenReady(id);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`);
    await row(page, 'finished').getByText('Completed').waitFor();
    const text = await row(page, 'finished').innerText();
    expect(text).toMatch(/642 points · cage of 42/);
    expect(text).toMatch(/24 frames/);
    const { l2, linf } = await errorsOf(site, await idOf(page, 'finished'));
    await row(page, 'finished').getByText(percent(l2)).waitFor();
    await row(page, 'finished').getByText(percent(linf)).waitFor();
    const { bytes } = await inspected(site, await idOf(page, 'finished'));
    await row(page, 'finished')
      .getByText(`${bytes.ratio.toFixed(bytes.ratio < 10 ? 1 : 0)}× smaller`)
      .waitFor();

    await row(page, 'arriving').getByText('no frames yet').waitFor();
    await client.post(id, capture, 0, 12);
    await row(page, 'arriving').getByText('12 frames').waitFor();
    await row(page, 'arriving').getByText('Running').waitFor();
    await client.complete(id, 12);
    await row(page, 'arriving').getByText('Completed').waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    expect(errors).toEqual([]);
    await close();
  });

  test('a_phone_shows_the_list_and_all_buttons_of_a_row_without_scrolling_sideways', async () => {
    await site.client().encode(capture, { name: 'a name that is longer than a phone is wide, twice over' }, 4);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`, [], PHONE);
    const button = page.getByRole('button', { name: /^Delete a name that is longer/ });
    await button.waitFor();
    await page.getByText('About CageR').tap();
    const width = await page.evaluate(() => document.querySelector('cager-sessions')!.scrollWidth);
    expect(width).toBeLessThanOrEqual(390);
    const { x, width: wide } = (await button.boundingBox())!;
    expect(x + wide).toBeLessThanOrEqual(390);
    expect(errors).toEqual([]);
    await close();
  });

  test('a_session_that_is_gone_leads_to_the_list', async () => {
    const { page, close } = await openPage(site.browser, `${site.page}#/session/0123456789abcdef`, ['404']);
    await page.getByRole('alert').waitFor();
    expect(await page.getByRole('button', { name: 'Try again' }).count()).toBe(0);
    await page.getByRole('link', { name: 'All sessions' }).click();
    await page.getByRole('heading', { name: 'Sessions', exact: true }).waitFor();
    await close();
  });

  test('a_failed_session_says_what_to_do', async () => {
    const client = site.client();
    const { id } = await client.create(capture, { name: 'broken' });
    await client.whenReady(id);
    await client.post(id, capture, 0, 2);
    await site.service.restartWithDamage(id);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`);
    await row(page, 'broken')
      .getByText(/upload the capture to a new session/)
      .waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    expect(errors).toEqual([]);
    await close();
  });

  test('the_list_is_used_by_keyboard_alone', async () => {
    const client = site.client();
    await client.encode(capture, { name: 'kept' }, 4);
    await client.encode(capture, { name: 'doomed' }, 4);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`);
    await row(page, 'doomed').waitFor();
    await tabTo(page, 'Search sessions by name, identifier or coordinates');
    await page.keyboard.type('do');
    await expect.poll(() => page.locator('cager-sessions tbody').count()).toBe(1);

    await tabTo(page, 'Delete doomed');
    await page.keyboard.press('Enter');
    await page.getByRole('dialog', { name: 'Delete “doomed”?' }).waitFor();
    expect(await focused(page)).toBe('Cancel');
    await page.keyboard.press('Escape');
    await expect.poll(() => page.getByRole('dialog').count()).toBe(0);
    expect(await focused(page)).toBe('Delete doomed');

    await tabTo(page, 'Rename doomed', true);
    await page.keyboard.press('Enter');
    await page.getByRole('dialog', { name: 'Rename “doomed”' }).waitFor();
    expect(await focused(page)).toBe('Name');
    await page.keyboard.type('do not keep');
    await page.keyboard.press('Enter');
    await row(page, 'do not keep').waitFor();
    await expect.poll(() => page.getByRole('dialog').count()).toBe(0);
    expect(await focused(page)).toBe('Rename do not keep');

    await tabTo(page, 'Delete do not keep');
    await page.keyboard.press('Enter');
    await tabTo(page, 'Delete');
    await page.keyboard.press('Enter');
    await expect.poll(() => page.locator('cager-sessions tbody').count()).toBe(0);
    expect(
      ((await (await client.call('')).json()) as { sessions: { name: string }[] }).sessions.map(({ name }) => name),
    ).not.toContain('do not keep');

    await tabTo(page, 'Search sessions by name, identifier or coordinates', true);
    await page.keyboard.press('Control+A');
    await page.keyboard.type('kept');
    await row(page, 'kept').waitFor();
    await tabTo(page, 'kept');
    await page.keyboard.press('Enter');
    await expect.poll(() => page.url()).toMatch(/#\/session\/[0-9a-f]+$/);
    expect(errors).toEqual([]);
    await close();
  });

  test('a_container_is_downloaded_whole', async () => {
    const client = site.client();
    const id = await client.encode(capture, { name: 'fetched/1' }, 6);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`);
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Download fetched/1' }).click();
    const file = await download;
    expect(file.suggestedFilename()).toBe('fetched-1.cager');
    const there = Buffer.from(await (await client.call(`/${id}/capture.cager`)).arrayBuffer());
    expect(there.equals(await readFile(await file.path()))).toBe(true);
    const decoded = page.waitForEvent('download');
    await page.getByLabel('Export fetched/1').selectOption('abc');
    const archive = await decoded;
    expect(archive.suggestedFilename()).toBe('fetched-1.abc');
    expect((await readFile(await archive.path())).subarray(0, 5).toString()).toBe('Ogawa');
    expect(errors).toEqual([]);
    await close();
  });

  test('a_service_that_is_away_is_told_of_and_comes_back', async () => {
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`, ['502', 'ERR_']);
    await row(page, 'finished').waitFor();
    await site.service.kill();
    await page
      .getByRole('alert')
      .getByText(/service/)
      .waitFor({ timeout: 15_000 });
    // What was there is still shown.
    expect(await row(page, 'finished').count()).toBe(1);
    await site.service.run();
    await expect.poll(() => page.getByRole('alert').count(), { timeout: 20_000 }).toBe(0);
    expect(errors).toEqual([]);
    await close();
  });

  test('a_page_that_nobody_sees_asks_for_nothing', async () => {
    const name = `waiting ${Date.now()}`;
    await site.client().create(capture, { name });
    const { page, close } = await openPage(site.browser, `${site.page}#/`);
    await row(page, name).waitFor();
    const setHidden = (hidden: boolean) =>
      page.evaluate((value) => {
        Object.defineProperty(document, 'hidden', { value, configurable: true });
        document.dispatchEvent(new Event('visibilitychange'));
      }, hidden);
    await setHidden(true);
    // What has begun may end.
    await page.waitForTimeout(2000);
    let asked = 0;
    page.on('request', () => (asked += 1));
    await page.waitForTimeout(2500);
    expect(asked).toBe(0);
    await site.client().encode(capture, { name: 'meanwhile' }, 2);
    await setHidden(false);
    await row(page, 'meanwhile').waitFor();
    await close();
  });

  test('older_pages_are_turned_to_and_searched', async () => {
    const small = new SphereCapture(1);
    const client = site.client();
    const oldest = await client.create(small, { name: 'oldest of many' });
    for (let k = 0; k < 100; k += 10) {
      await Promise.all(Array.from({ length: 10 }, (_, i) => client.create(small, { name: `one of many ${k + i}` })));
    }
    await client.create(small, { name: 'newest of many' });
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/`);
    await row(page, 'newest of many').waitFor();
    expect(await page.locator('cager-sessions tbody').count()).toBe(25);
    await page.getByRole('button', { name: 'Older' }).click();
    await expect.poll(() => row(page, 'newest of many').count()).toBe(0);
    await page.getByText('26–50 of').waitFor();
    await page.getByRole('button', { name: 'Newer' }).click();
    await row(page, 'newest of many').waitFor();
    // It is on the second page that the service gives: both are asked for at once, without waiting for the list to be renewed.
    await page.getByRole('searchbox').fill('oldest of');
    await row(page, 'oldest of many').waitFor();
    expect(await idOf(page, 'oldest of many')).toBe(oldest.id);
    await page.getByRole('searchbox').fill('');
    for (let k = 0; k < 4; k += 1) await page.getByRole('button', { name: 'Older' }).click();
    await row(page, 'oldest of many').waitFor();

    // The page, and what is searched, are there again after a look at a session, and after a reload.
    await expect.poll(() => page.url()).toMatch(/#\/\?page=5$/);
    await page.reload();
    await row(page, 'oldest of many').waitFor();
    await page.getByRole('searchbox').fill('newest of');
    await page.getByRole('button', { name: 'Running' }).click();
    await row(page, 'newest of many').getByRole('link').click();
    await page.getByRole('link', { name: 'All sessions' }).click();
    await row(page, 'newest of many').waitFor();
    expect(page.url()).toMatch(/#\/\?search=newest\+of&state=running$/);
    expect(await page.getByRole('searchbox').inputValue()).toBe('newest of');
    expect(await page.locator('cager-sessions tbody').count()).toBe(1);
    await page.goBack();
    await page.goBack();
    await row(page, 'newest of many').waitFor();
    expect(await page.getByRole('button', { name: 'Running' }).getAttribute('aria-pressed')).toBe('true');
    expect(errors).toEqual([]);
    await close();
  });
});

describe.skipIf(missing)('a service with tokens', { timeout: 120_000 }, () => {
  let site: Site;

  beforeAll(async () => {
    site = await Site.start({ 'studio-a': TOKEN_A, 'studio-b': TOKEN_B });
  }, 120_000);

  afterAll(() => site.close());

  test('signing_in_shows_the_tenants_own_sessions', async () => {
    const mine = await site.client(TOKEN_A).encode(capture, { name: 'mine' }, 3);
    const theirs = await site.client(TOKEN_B).encode(capture, { name: 'theirs' }, 3);
    const { page, errors, close } = await openPage(site.browser, `${site.page}#/?page=2`, ['401']);
    const field = page.getByLabel('Access token');
    await field.waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await field.fill('wrong');
    await page.keyboard.press('Enter');
    await page.getByText('The token was not accepted').waitFor();
    await field.fill(TOKEN_A);
    await page.keyboard.press('Enter');
    await row(page, 'mine').waitFor();
    expect(await row(page, 'theirs').count()).toBe(0);
    expect(page.url()).not.toContain('token');
    expect(page.url()).toMatch(/#\/\?page=2$/);

    // It outlives a reload, and a download has it.
    await page.reload();
    await row(page, 'mine').waitFor();
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Download mine' }).click();
    expect((await readFile(await (await download).path())).length).toBeGreaterThan(1000);
    expect(errors).toEqual([]);

    await page.getByRole('button', { name: 'Sign out' }).click();
    await field.waitFor();
    expect(page.url()).toMatch(/#\/$/);
    expect(mine).not.toBe(theirs);
    await close();
  });

  test('another_tenants_session_is_a_sentence', async () => {
    const theirs = await site.client(TOKEN_B).encode(capture, { name: 'theirs' }, 3);
    const { page, close } = await openPage(site.browser, site.server.parts, ['404']);
    const said = await page.evaluate(
      async ([token, id]) => {
        window.parts.pageToken.set(token, false);
        return window.parts.openSession(id).then(
          () => 'opened',
          (error: unknown) => (error as Error).message,
        );
      },
      [TOKEN_A, theirs],
    );
    expect(said).toMatch(/^Not found: .* belongs to someone else\./);
    await close();
  });
});

function row(page: Page, name: string) {
  return page.locator('cager-sessions tbody').filter({ has: page.getByRole('link', { name, exact: true }) });
}

async function idOf(page: Page, name: string): Promise<string> {
  return (await row(page, name).getAttribute('data-id'))!;
}

/** Mean over the frames of the one error, largest of the other. */
async function errorsOf(site: Site, id: string) {
  const { frames } = (await (await site.client().call(`/${id}/errors`)).json()) as {
    frames: { l2: number; linf: number }[];
  };
  return {
    l2: frames.reduce((sum, { l2 }) => sum + l2, 0) / frames.length,
    linf: Math.max(...frames.map(({ linf }) => linf)),
  };
}

/** What the program says of a session's container. */
async function inspected(site: Site, id: string) {
  const folder = await mkdtemp(join(tmpdir(), 'cager-web-'));
  try {
    const file = join(folder, 'capture.cager');
    await writeFile(file, Buffer.from(await (await site.client().call(`/${id}/capture.cager`)).arrayBuffer()));
    const report = execFileSync(cager!, ['inspect', file, '--json'], { encoding: 'utf8' });
    return JSON.parse(report) as { bytes: { ratio: number } };
  } finally {
    await rm(folder, { recursive: true });
  }
}

function percent(fraction: number): string {
  return `${Number((100 * fraction).toPrecision(2))} %`;
}

/** What the focused element is called. */
function focused(page: Page): Promise<string> {
  return page.evaluate(() => {
    let at = document.activeElement;
    while (at?.shadowRoot?.activeElement) at = at.shadowRoot.activeElement;
    return (at?.getAttribute('aria-label') ?? at?.textContent ?? '').trim();
  });
}

async function tabTo(page: Page, name: string, backwards = false): Promise<void> {
  for (let presses = 0; presses < 80; presses += 1) {
    if ((await focused(page)) === name) return;
    await page.keyboard.press(backwards ? 'Shift+Tab' : 'Tab');
  }
  throw new Error(`${name} cannot be reached by the key Tab`);
}
