import { afterEach, expect, test, vi } from 'vitest';
import type { Capture, FrameBlock, Residual } from '../capture';
import { FrameStore } from './frameStore';
import type { ToResidualWorker } from './residualWorker';

const NO_RESIDUAL: Residual = {
  rank: 0,
  trajectories: new Float32Array(0),
  shapes: new Float32Array(0),
  correctionStarts: new Uint32Array(0),
  correctedPoints: new Uint32Array(0),
  correctionVectors: new Float32Array(0),
};

/** A capture of one row a frame, whose blocks come from `block`. */
function captureOf(points: number, frames: number, block: (frame: number) => Promise<FrameBlock>): Capture {
  const cage = { positions: new Float64Array(3), triangles: new Uint32Array(0) };
  const [cornerCounts, corners] = [new Uint32Array(0), new Uint32Array(0)];
  const rest = new Float64Array(3 * points);
  return {
    name: 'capture',
    static: { system: 'mvc', rest, cornerCounts, corners, cage, rowsPerFrame: 1, frameRate: null, report: null },
    frames,
    complete: true,
    errors: { l2: new Float32Array(0), linf: new Float32Array(0) },
    frameNumbers: null,
    block,
    events: new EventTarget(),
    problem: null,
    close: () => undefined,
  };
}

/** Node has no web workers: this one answers later. */
class AnsweringWorker {
  static frames = 0;
  static last: AnsweringWorker;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  onFailure: () => void = () => undefined;

  constructor() {
    AnsweringWorker.last = this;
  }

  addEventListener(type: string, listener: () => void) {
    if (type === 'error') this.onFailure = listener;
  }

  postMessage(message: ToResidualWorker) {
    if (message.kind !== 'frame') return;
    AnsweringWorker.frames++;
    const { block, index } = message;
    setTimeout(() => this.onmessage?.({ data: { block, index, offsets: new Float32Array(4) } }));
  }

  terminate() {
    this.onmessage = null;
  }
}

function stubWorkers() {
  vi.stubGlobal('Worker', AnsweringWorker);
  vi.stubGlobal('document', { baseURI: 'http://localhost/' });
  vi.stubGlobal('location', { origin: 'http://localhost' });
}

afterEach(() => vi.unstubAllGlobals());

const settled = () => new Promise((resolve) => setTimeout(resolve, 30));

test('blocks of another source replace all that are there, and those on their way', async () => {
  const answers: ((block: FrameBlock) => void)[] = [];
  const capture = captureOf(1, 4, () => new Promise((resolve) => answers.push(resolve)));
  const store = new FrameStore(capture);
  const blockOf = (first: number, value: number) => {
    return { first, count: 2, cages: new Float32Array(6).fill(value), residual: null };
  };
  const early = store.load(0);
  answers[0](blockOf(0, 1));
  await early;
  const late = store.frame(2);
  const onReplaced = vi.fn();
  store.onReplaced = onReplaced;
  capture.events.dispatchEvent(new Event('replaced'));
  expect(onReplaced).toHaveBeenCalledOnce();
  expect(store.peek(0)).toBeNull();
  answers[1](blockOf(2, 1));
  await settled();
  answers[2](blockOf(2, 7));
  expect((await late).rows[0]).toBe(7);
});

test('a paused picture of a large model comes to rest, and a far frame can be read meanwhile', async () => {
  stubWorkers();
  const cages = new Float32Array(3 * 200);
  const block = { first: 0, count: 200, cages, residual: NO_RESIDUAL };
  const store = new FrameStore(captureOf(500_000, 200, () => Promise.resolve(block)));
  const ahead = Array.from({ length: 24 }, (_, k) => 50 + k);
  store.onArrival = () => store.prefetch(ahead);
  store.prefetch(ahead);
  await settled();
  await settled();
  expect(AnsweringWorker.frames).toBeLessThan(24);
  expect(AnsweringWorker.frames).toBeGreaterThan(4);
  expect((await store.frame(199)).offsets).not.toBeNull();
  for (let frame = 100; frame < 110; frame++) await store.frame(frame);
  expect(store.peek(50)).not.toBeNull();
  const asked = AnsweringWorker.frames;
  await settled();
  expect(AnsweringWorker.frames).toBe(asked);
});

test('preliminary frames are shown until their final ones can be', async () => {
  stubWorkers();
  let answer: (() => void) | null = null;
  const [solved, coded] = [new Float32Array(3 * 8).fill(1), new Float32Array(3 * 6).fill(2)];
  const preliminary = { first: 0, count: 8, cages: solved, residual: null, isPreliminary: true };
  const final = { first: 0, count: 6, cages: coded, residual: NO_RESIDUAL };
  let isFinal = false;
  const capture = captureOf(1, 8, () => {
    if (!isFinal) return Promise.resolve(preliminary);
    return new Promise((resolve) => (answer = () => resolve(final)));
  });
  capture.hasFinal = (frame) => isFinal && frame < 6;
  const store = new FrameStore(capture);
  const onReplaced = vi.fn();
  store.onReplaced = onReplaced;
  await store.load(3);
  isFinal = true;
  const ahead = [3, 4, 5, 6, 7];
  store.prefetch(ahead);
  await settled();
  expect(store.peek(3)?.rows[0]).toBe(1);
  answer!();
  await Promise.resolve();
  store.onArrival = () => {
    store.prefetch(ahead);
    expect(store.peek(3)).not.toBeNull();
  };
  await settled();
  await settled();
  expect(ahead.map((frame) => store.peek(frame)?.rows[0])).toEqual([2, 2, 2, 1, 1]);
  expect(store.peek(3)?.offsets).not.toBeNull();
  expect(onReplaced).toHaveBeenCalledOnce();
  expect((await store.frame(0)).rows[0]).toBe(2);
});

test('a block that was read is not asked for again by whoever plays', async () => {
  const asked: number[] = [];
  const store = new FrameStore(
    captureOf(1, 4, (frame) => {
      asked.push(frame);
      return Promise.resolve({ first: frame - (frame % 2), count: 2, cages: new Float32Array(6), residual: null });
    }),
  );
  const heard: number[] = [];
  store.onBlock = ({ first }) => heard.push(first);
  await store.read(2);
  await store.load(3);
  store.prefetch([2, 3]);
  expect([asked, heard]).toEqual([[2], [2]]);
  expect(store.peek(3)).not.toBeNull();
  store.close();
});

test('frames are loaded ahead also while others read some', async () => {
  const asked: number[] = [];
  const capture = captureOf(1, 4, (frame) => {
    asked.push(frame);
    return new Promise(() => undefined);
  });
  const store = new FrameStore(capture);
  store.read(2).catch(() => undefined);
  store.prefetch([0, 1]);
  store.prefetch([0, 1]);
  await settled();
  expect(asked).toEqual([2, 0]);
});

test('whoever waits for offsets hears that their script did not come, and edits keep the offsets', async () => {
  stubWorkers();
  const cages = Float32Array.of(1, 2, 3, 4, 5, 6);
  const store = new FrameStore(
    captureOf(1, 2, () => Promise.resolve({ first: 0, count: 2, cages, residual: NO_RESIDUAL })),
  );
  store.edit = (_, rows) => rows.map((x) => 10 * x);
  const { rows, offsets } = await store.frame(0);
  expect([...rows]).toEqual([10, 20, 30]);
  expect(offsets).not.toBeNull();
  const waiting = store.frame(1);
  await Promise.resolve();
  await Promise.resolve();
  AnsweringWorker.last.onmessage = null;
  AnsweringWorker.last.onFailure();
  await expect(waiting).rejects.toThrow('could not be loaded. Reload the page.');
  await expect(store.load(1)).rejects.toThrow('Reload the page.');
  store.close();
});
