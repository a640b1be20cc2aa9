import { execFile } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import type { Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import { diagonalOf } from '../../src/coordinates/topology';
import { weightAt } from '../../src/editing/cageEdit';
import type { CagerViewer } from '../../src/viewer/cagerViewer';
import { seriousFindings } from './harness/axe';
import { openPage, type Watched } from './harness/browser';
import { cager, missing } from './harness/programs';
import { Site } from './harness/site';
import { SphereCapture } from './harness/sphere';
import { whenShown } from './harness/viewing';
import { parseNpy } from './npy';

const FRAMES = 30;
const run = promisify(execFile);

describe.skipIf(missing)('editing', { timeout: 90_000 }, () => {
  const sphere = new SphereCapture(2);
  let site: Site;
  let session: string;
  let folder: string;
  let diagonal: number;
  let watched: Watched | null = null;

  beforeAll(async () => {
    site = await Site.start();
    session = await site.client().encode(sphere, { name: 'wave' }, FRAMES);
    folder = await mkdtemp(join(tmpdir(), 'cager-editing-'));
    const rest = sphere.rest.match(/^v .*$/gm)!.flatMap((line) => line.slice(2).split(' ').map(Number));
    diagonal = diagonalOf(Float64Array.from(rest));
  }, 120_000);

  afterAll(async () => {
    await site.close();
    await rm(folder, { recursive: true, force: true });
  });

  afterEach(async () => {
    await watched?.close();
    watched = null;
  });

  /** Opens the session, stands still at a frame and begins to edit. */
  async function editing(frame: number): Promise<Page> {
    watched = await openPage(site.browser, `${site.page}#/session/${session}?frame=${frame}`);
    const { page } = watched;
    await whenShown(page);
    await page.keyboard.press('e');
    await page.getByRole('region', { name: 'Edit cage' }).waitFor();
    return page;
  }

  /** Drags the vertex of the cage that is nearest to the middle of the picture; returns its number. */
  async function dragVertex(page: Page, byX: number, byY: number): Promise<number> {
    const { vertex, x, y } = await withViewer(page, (viewer) => {
      const { width, height, left, top } = viewer.renderRoot.querySelector('canvas')!.getBoundingClientRect();
      const away = (place: { x: number; y: number }) => Math.hypot(place.x - width / 2, place.y - height / 2);
      const places = viewer.editing.editor!.places.map((place, vertex) => ({ ...place!, vertex }));
      const [nearest] = places.filter(({ isBehind }) => !isBehind).sort((a, b) => away(a) - away(b));
      return Promise.resolve({ vertex: nearest.vertex, x: nearest.x + left, y: nearest.y + top });
    });
    await page.mouse.move(x, y);
    await page.mouse.down();
    for (let k = 1; k <= 4; k++) await page.mouse.move(x + (byX * k) / 4, y + (byY * k) / 4);
    await page.mouse.up();
    return vertex;
  }

  const distances = (a: readonly number[], b: readonly number[]) =>
    Array.from({ length: a.length / 3 }, (_, p) =>
      Math.hypot(a[3 * p] - b[3 * p], a[3 * p + 1] - b[3 * p + 1], a[3 * p + 2] - b[3 * p + 2]),
    );
  const farthest = (a: readonly number[], b: readonly number[]) => Math.max(...distances(a, b)) / diagonal;

  it('the model follows a dragged vertex near it, and undo and redo go back and forth', async () => {
    const page = await editing(12);
    await setRadius(page, 0);
    const before = await readPositions(page, 12);
    const vertex = await dragVertex(page, 60, -40);
    const after = await readPositions(page, 12);
    // The chart has no errors where they are those of other cages.
    const timeline = page.getByRole('slider', { name: 'Frame', exact: true });
    await expect.poll(() => timeline.getAttribute('aria-valuetext')).toBe('frame 12 · edited: errors are not measured');
    const line = page.locator('cager-timeline .chart path.line').first();
    const charted = async () => (await line.getAttribute('d'))!.match(/[ML]/g)!.length;
    await expect.poll(charted).toBeLessThan(FRAMES / 2);
    const moved = distances(before, after);
    const place = await withViewer(page, (viewer) =>
      Promise.resolve([...viewer.editing.editor!.model.graph.cage.positions]),
    );
    const rest = sphere.rest.match(/^v .*$/gm)!.map((line) => line.slice(2).split(' ').map(Number));
    const from = place.slice(3 * vertex, 3 * vertex + 3);
    const order = rest
      .map((point, p) => ({ p, away: Math.hypot(...point.map((x, k) => x - from[k])) }))
      .sort((a, b) => a.away - b.away);
    const near = moved[order[0].p];
    expect(near / diagonal).toBeGreaterThan(0.01);
    for (const { p } of order.slice(-order.length / 4)) expect(moved[p]).toBeLessThan(0.05 * near);
    await page.keyboard.press('Control+z');
    await expect.poll(charted).toBe(FRAMES);
    expect(await readPositions(page, 12)).toEqual(before);
    await page.keyboard.press('Control+Shift+z');
    expect(await readPositions(page, 12)).toEqual(after);
    expect(watched?.errors).toEqual([]);
  });

  it('a falloff takes the neighbourhood along, symmetry the other side, and a box chooses all in it', async () => {
    const page = await editing(0);
    const movedVertices = async () => {
      const weights = await withViewer(page, (viewer) => {
        const { own, mirror } = viewer.editing.editor!.model.edits.at(-1)!.grip;
        return Promise.resolve([...own.map((weight, v) => Math.max(weight, mirror?.own[v] ?? 0))]);
      });
      return weights.filter((weight) => weight > 0).length;
    };
    await setRadius(page, 0);
    await dragVertex(page, 30, 0);
    expect(await movedVertices()).toBe(1);
    await page.keyboard.press('Control+z');
    await page.getByRole('button', { name: 'Across x' }).click();
    await page
      .locator('cager-viewer canvas')
      .first()
      .click({ position: { x: 500, y: 40 } });
    await page.keyboard.press('Enter');
    await page.keyboard.press('Alt+ArrowRight');
    await page.keyboard.press('Alt+ArrowRight');
    await page.keyboard.press('ArrowUp');
    expect(await movedVertices()).toBe(2);
    await setRadius(page, 30);
    await page.locator('cager-viewer canvas').first().focus();
    await page.keyboard.press('ArrowUp');
    expect(await movedVertices()).toBeGreaterThan(6);
    await page.keyboard.press('Escape');
    await page.keyboard.down('Shift');
    await page.mouse.move(420, 110);
    await page.mouse.down();
    await page.mouse.move(1100, 620, { steps: 4 });
    await page.mouse.up();
    await page.keyboard.up('Shift');
    const chosen = await withViewer(page, ({ editing }) => Promise.resolve(editing.editor!.model.selection.length));
    expect(chosen).toBeGreaterThan(10);
    expect(watched?.errors).toEqual([]);
  });

  it('an edit is kept over its range of frames, with ease in and out', async () => {
    const page = await editing(12);
    await dragVertex(page, 50, 20);
    const fields = { First: 6, Last: 20, 'Ease in': 4, 'Ease out': 6 };
    for (const [name, value] of Object.entries(fields)) {
      const field = page.getByRole('spinbutton', { name });
      await field.fill(String(value));
      await field.press('Tab');
    }
    await expect.poll(() => page.locator('cager-range-strip polygon').count()).toBe(1);
    const frames = [5, 6, 8, 12, 16, 20, 21];
    const edited = await Promise.all(frames.map((frame) => readPositions(page, frame)));
    await page.getByRole('checkbox', { name: /^Enable edit of Vertex/ }).uncheck();
    const plain = await Promise.all(frames.map((frame) => readPositions(page, frame)));
    const moved = frames.map((_, k) => farthest(edited[k], plain[k]));
    const whole = moved[3];
    expect(whole).toBeGreaterThan(0.01);
    frames.forEach((frame, k) => {
      const weight = weightAt({ first: 6, last: 20, easeIn: 4, easeOut: 6 }, frame);
      expect(moved[k] / whole, `frame ${frame}`).toBeCloseTo(weight, 3);
    });
    expect(watched?.errors).toEqual([]);
  });

  it('ranges are dragged below the timeline: ends, eases, and all of it', async () => {
    const page = await editing(14);
    const range = () => withViewer(page, ({ editing }) => Promise.resolve(editing.range!));
    await page.locator('cager-range-strip .ground').waitFor();
    const covered = () =>
      withViewer(page, (viewer) => Promise.resolve(viewer.style.getPropertyValue('--covered-height')));
    const before = await covered();
    await dragVertex(page, 40, 20);
    expect(await range()).toEqual({ first: 2, last: 26, easeIn: 12, easeOut: 12 });
    // As much of the picture is covered as before, so that nothing jumps under the pointer.
    expect(await covered()).toBe(before);
    const strip = (await page.locator('cager-range-strip').boundingBox())!;
    const placeOf = (frame: number, isUpper: boolean) => ({
      x: strip.x + (strip.width * frame) / (FRAMES - 1),
      y: strip.y + strip.height * (isUpper ? 0.25 : 0.75),
    });
    const drag = async (from: number, to: number, isUpper: boolean) => {
      const [a, b] = [placeOf(from, isUpper), placeOf(to, isUpper)];
      await page.mouse.move(a.x, a.y);
      await page.mouse.down();
      await page.mouse.move(b.x, b.y, { steps: 4 });
      await page.mouse.up();
    };
    await drag(26, 22, false);
    expect(await range()).toEqual({ first: 2, last: 22, easeIn: 12, easeOut: 8 });
    await drag(14, 6, true);
    expect(await range()).toEqual({ first: 2, last: 22, easeIn: 4, easeOut: 8 });
    await drag(10, 12, false);
    expect(await range()).toEqual({ first: 4, last: 24, easeIn: 4, easeOut: 8 });
    expect(await page.getByRole('spinbutton', { name: 'Last' }).inputValue()).toBe('24');
    // The capture stayed where it was, and each drag is one step back.
    expect(await withViewer(page, (viewer) => Promise.resolve(viewer.frame))).toBe(14);
    await page.keyboard.press('Control+z');
    expect(await range()).toEqual({ first: 2, last: 22, easeIn: 4, easeOut: 8 });
    expect(watched?.errors).toEqual([]);
  });

  it('vertices are rotated and scaled about their pivot by ring, arrow and keys, and exported so', async () => {
    const page = await editing(12);
    await setRadius(page, 0);
    const chosen = await withViewer(page, ({ editing }) => {
      const { editor } = editing;
      const order = editor!.places.map((place, v) => ({ v, y: place!.y })).sort((a, b) => a.y - b.y);
      editor!.select(order.slice(0, 12).map(({ v }) => v));
      return Promise.resolve([...editor!.model.selection]);
    });
    await page.locator('cager-viewer canvas').first().focus();
    await page.keyboard.press('r');
    expect(await page.getByRole('button', { name: 'Rotate' }).getAttribute('aria-pressed')).toBe('true');
    /** The cage as it was drawn last. */
    const cage = () => withViewer(page, ({ player }) => Promise.resolve([...player!.stage.cageVertices]));
    const sizeOf = (positions: readonly number[]) => {
      const mean = [0, 1, 2].map((k) => chosen.reduce((sum, v) => sum + positions[3 * v + k], 0) / chosen.length);
      return chosen.map((v) => Math.hypot(...mean.map((x, k) => positions[3 * v + k] - x)));
    };
    const before = await cage();
    const grip = await withViewer(page, ({ editing, renderRoot }) => {
      const { left, top } = renderRoot.querySelector('canvas')!.getBoundingClientRect();
      const { rings, middle } = editing.editor!.gizmo!;
      const [from] = rings[3].points;
      return Promise.resolve({ x: left + from.x, y: top + from.y, middleX: left + middle.x, middleY: top + middle.y });
    });
    await page.mouse.move(grip.x, grip.y);
    await page.mouse.down();
    // A quarter of a turn clockwise.
    const [dx, dy] = [grip.x - grip.middleX, grip.y - grip.middleY];
    await page.mouse.move(grip.middleX - dy, grip.middleY + dx, { steps: 6 });
    await page.mouse.up();
    await expect.poll(async () => farthest(before, await cage())).toBeGreaterThan(0.02);
    sizeOf(await cage()).forEach((size, k) => expect(size).toBeCloseTo(sizeOf(before)[k], 4));
    await page.getByText('90°').waitFor();

    await page.keyboard.press('u');
    for (let k = 0; k < 3; k++) await page.keyboard.press('Shift+ArrowUp');
    const growth = async () => {
      const sizes = sizeOf(await cage());
      return sizeOf(before).map((size, k) => sizes[k] / size);
    };
    await expect.poll(async () => Math.min(...(await growth()))).toBeCloseTo(1.1 ** 3, 3);
    expect(Math.max(...(await growth()))).toBeCloseTo(1.1 ** 3, 3);
    expect(await withViewer(page, ({ editing }) => Promise.resolve(editing.editor!.model.edits.length))).toBe(2);
    expect(await seriousFindings(page)).toEqual([]);

    const button = page.getByRole('button', { name: 'Save .cager' });
    const [saved] = await Promise.all([page.waitForEvent('download'), button.click()]);
    const [path, output] = ['turned.cager', 'turned.npy'].map((name) => join(folder, name));
    await saved.saveAs(path);
    await run(cager!, ['decode', path, '-o', output, '--overwrite', '-q']);
    const { values } = parseNpy(await readFile(output));
    const original = await readFrames(session);
    const length = 3 * sphere.points;
    const of = (all: Float32Array | Float64Array, frame: number) => [
      ...all.slice(frame * length, (frame + 1) * length),
    ];
    expect(farthest(await readPositions(page, 12), of(values, 12))).toBeLessThan(1e-4);
    expect(of(values, FRAMES - 1)).toEqual(of(original, FRAMES - 1));
    expect(farthest(of(values, 12), of(original, 12))).toBeGreaterThan(0.02);
    const { stdout, stderr } = await run(cager!, ['inspect', path]);
    expect(stdout + stderr).toMatch(/Vertex|vertices/);
    expect(watched?.errors).toEqual([]);
  });

  it('edits are still there after a reload, to be taken up again or thrown away', async () => {
    const page = await editing(12);
    await dragVertex(page, 60, -30);
    const edited = await readPositions(page, 12);
    await kept(page);
    const reload = async () => {
      await page.reload();
      await whenShown(page);
    };
    await reload();
    const plain = await readPositions(page, 12);
    expect(farthest(plain, edited)).toBeGreaterThan(0.01);
    await page.getByText(/^1 edit kept in this browser, from/).waitFor();
    // Known by the session's address: that of a running one has no container yet.
    expect(await withViewer(page, ({ player }) => Promise.resolve(player!.capture.identity))).toMatch(session);
    expect(await seriousFindings(page)).toEqual([]);
    // Whoever edits before answering loses neither.
    await page.keyboard.press('e');
    await page.getByRole('region', { name: 'Edit cage' }).waitFor();
    await dragVertex(page, -40, 10);
    await kept(page);
    await reload();
    await page.getByText(/^2 edits kept in this browser, from/).waitFor();
    await page.getByRole('button', { name: 'Restore' }).click();
    await page
      .getByRole('checkbox', { name: /^Enable edit of Vertex/ })
      .nth(1)
      .waitFor();
    await page
      .getByRole('checkbox', { name: /^Enable edit of Vertex/ })
      .nth(1)
      .uncheck();
    expect(await readPositions(page, 12)).toEqual(edited);
    await kept(page);
    await reload();
    // Nothing goes by one click.
    await page.getByRole('button', { name: 'Discard' }).click();
    const question = page.getByRole('dialog', { name: 'Discard 2 edits?' });
    await question.getByRole('button', { name: 'Cancel' }).click();
    await kept(page);
    await reload();
    await page.getByRole('button', { name: 'Discard' }).click();
    await question.getByRole('button', { name: 'Discard' }).click();
    await kept(page);
    await reload();
    await page.waitForTimeout(500);
    expect(await page.locator('cager-kept-offer').count()).toBe(0);
    expect(await readPositions(page, 12)).toEqual(plain);
    expect(watched?.errors).toEqual([]);
  });

  it('of two tabs with the same capture one keeps edits, and the other one says so until it is closed', async () => {
    const first = await editing(12);
    await dragVertex(first, 60, -30);
    await kept(first);
    const context = first.context();
    const open = async () => {
      const page = await context.newPage();
      await page.goto(`${site.page}#/session/${session}?frame=12`);
      await whenShown(page);
      return page;
    };
    const second = await open();
    await second.keyboard.press('e');
    const sentence = second.getByText('Another tab keeps its edits');
    await sentence.waitFor();
    await dragVertex(second, -40, 10);
    await second.waitForTimeout(600);
    expect(await second.locator('cager-kept-offer').count()).toBe(0);
    await first.close();
    // What the first tab kept is still there, and from now on the second one keeps its own beside it.
    await second.getByText(/^1 edit kept in this browser, from/).waitFor();
    await expect.poll(() => sentence.count()).toBe(0);
    await kept(second);
    await second.close();
    await (await open()).getByText(/^2 edits kept in this browser, from/).waitFor();
    expect(watched?.errors).toEqual([]);
  });

  it('a browser that keeps nothing says so, and edits all the same', async () => {
    watched = await openPage(site.browser, 'about:blank');
    const { page } = watched;
    await page.addInitScript(() => Object.defineProperty(globalThis, 'indexedDB', { value: undefined }));
    await page.goto(`${site.page}#/session/${session}?frame=12`);
    await whenShown(page);
    await page.keyboard.press('e');
    await page.getByRole('region', { name: 'Edit cage' }).waitFor();
    const before = await readPositions(page, 12);
    await dragVertex(page, 40, 20);
    expect(farthest(before, await readPositions(page, 12))).toBeGreaterThan(0.01);
    await page.getByText('export them before you leave').waitFor();
    expect(watched.errors).toEqual([]);
  });

  it('works by keyboard alone, without a trap, and passes the checks of accessibility', async () => {
    const page = await editing(3);
    const state = () =>
      withViewer(page, ({ editing }) => {
        const { selection, edits } = editing.editor!.model;
        return Promise.resolve({ isOn: editing.isOn, chosen: [...selection], edits: edits.length });
      });
    const before = await readPositions(page, 3);
    await page.keyboard.press('Enter');
    const [first] = (await state()).chosen;
    await page.keyboard.press('Tab');
    expect((await state()).chosen).toEqual([first + 1]);
    await page.keyboard.press('Shift+Tab');
    expect((await state()).chosen).toEqual([first]);
    await page.keyboard.press('Shift+ArrowUp');
    await page.keyboard.press('PageUp');
    await page.keyboard.press('ArrowRight');
    expect(await state()).toEqual({ isOn: true, chosen: [first], edits: 1 });
    expect(farthest(before, await readPositions(page, 3))).toBeGreaterThan(0.001);
    expect(await seriousFindings(page)).toEqual([]);
    await page.keyboard.press('Escape');
    expect((await state()).chosen).toEqual([]);
    await page.keyboard.press('Tab');
    expect(await page.evaluate(() => document.activeElement?.tagName)).not.toBe('BODY');
    expect((await state()).chosen).toEqual([]);
    // Presses within a second are one step; this machine may be slower.
    for (let k = 0; k < 3; k++) await page.keyboard.press('Control+z');
    expect(await readPositions(page, 3)).toEqual(before);
    await page.keyboard.press('Escape');
    await expect.poll(async () => (await state()).isOn).toBe(false);
    expect(watched?.errors).toEqual([]);
  });

  it('an exported container and decoded frames are what the page shows', async () => {
    const page = await editing(12);
    await dragVertex(page, 70, 30);
    const download = async (name: string) => {
      const button = page.getByRole('button', { name, exact: true });
      const [saved] = await Promise.all([page.waitForEvent('download'), button.click()]);
      return { name: saved.suggestedFilename(), content: await readFile(await saved.path()) };
    };
    const container = await download('Save .cager');
    const positions = await download('Save positions (.npy)');
    expect([container.name, positions.name]).toEqual(['wave-edited.cager', 'wave-edited.npy']);

    const [path, output] = ['edited.cager', 'decoded.npy'].map((name) => join(folder, name));
    await writeFile(path, container.content);
    await run(cager!, ['decode', path, '-o', output, '--overwrite', '-q']);
    const decoded = parseNpy(await readFile(output));
    const sent = parseNpy(positions.content);
    expect(sent.shape).toEqual(decoded.shape);
    expect(sent.shape).toEqual([FRAMES, sphere.points, 3]);
    const length = 3 * sphere.points;
    const original = await readFrames(session);
    for (const frame of [0, 6, 12, FRAMES - 1]) {
      const shown = await readPositions(page, frame);
      for (const { values } of [decoded, sent]) {
        expect(farthest(shown, [...values.slice(frame * length, (frame + 1) * length)])).toBeLessThan(1e-4);
      }
    }
    const last = (FRAMES - 1) * length;
    expect(decoded.values.slice(last)).toEqual(original.slice(last));
    expect(decoded.values.slice(12 * length, 13 * length)).not.toEqual(original.slice(12 * length, 13 * length));
    const { stdout, stderr } = await run(cager!, ['inspect', path]);
    expect(stdout + stderr).toMatch(/Vertex|vertices/);
    expect(watched?.errors).toEqual([]);
  });

  /** What the program decodes of a session's own container. */
  async function readFrames(id: string): Promise<Float32Array | Float64Array> {
    const response = await site.client().call(`/${id}/capture.cager`);
    const [path, output] = ['original.cager', 'original.npy'].map((name) => join(folder, name));
    await writeFile(path, new Uint8Array(await response.arrayBuffer()));
    await run(cager!, ['decode', path, '-o', output, '--overwrite', '-q']);
    return parseNpy(await readFile(output)).values;
  }
});

/** Runs something in the page with its viewer; `of` must not refer to anything outside. */
async function withViewer<T>(page: Page, of: (viewer: CagerViewer) => Promise<T>): Promise<T> {
  return page.evaluate(
    `(${of.toString()})(document.querySelector('cager-viewer-page').shadowRoot.querySelector('cager-viewer'))`,
  );
}

/** Waits until the browser has kept the edits. */
function kept(page: Page): Promise<void> {
  return withViewer(page, ({ editing }) =>
    (editing as unknown as { keeper: { write(): Promise<void> } }).keeper.write(),
  );
}

async function readPositions(page: Page, frame: number): Promise<number[]> {
  return page.evaluate(
    `document.querySelector('cager-viewer-page').shadowRoot.querySelector('cager-viewer').readPositions(${frame}).then((positions) => [...positions])`,
  );
}

async function setRadius(page: Page, percent: number) {
  await page.getByRole('slider', { name: 'Falloff' }).fill(String(percent));
}
