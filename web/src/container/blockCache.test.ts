import { describe, expect, it } from 'vitest';
import type { FrameBlock } from '../capture';
import { BlockCache } from './blockCache';

/** A cache whose blocks are loaded when the test says so. */
function setUp() {
  const loading: { first: number; signal: AbortSignal; finish: () => void; fail: (error: Error) => void }[] = [];
  const cache = new BlockCache(
    (first, signal) =>
      new Promise((resolve, reject) => {
        const block: FrameBlock = { first, count: 1, cages: new Float32Array(4), residual: null };
        loading.push({ first, signal, finish: () => resolve(block), fail: reject });
      }),
  );
  return { cache, loading };
}

const settled = () => new Promise((resolve) => setTimeout(resolve));

describe('BlockCache', () => {
  it('loads a block once for all who ask, and keeps it', async () => {
    const { cache, loading } = setUp();
    const both = Promise.all([cache.get(3), cache.get(3)]);
    loading[0].finish();
    const [a, b] = await both;
    expect(a).toBe(b);
    expect(await cache.get(3)).toBe(a);
    expect(loading.length).toBe(1);
  });

  it('goes on loading for one who waits when another gives up', async () => {
    const { cache, loading } = setUp();
    const abort = new AbortController();
    const given = cache.get(3, abort.signal);
    const waiting = cache.get(3);
    abort.abort(new Error('enough'));
    await expect(given).rejects.toThrow('enough');
    expect(loading[0].signal.aborted).toBe(false);
    loading[0].finish();
    expect((await waiting).first).toBe(3);
  });

  it('stops loading what nobody waits for, and loads it anew', async () => {
    const { cache, loading } = setUp();
    const abort = new AbortController();
    const given = cache.get(3, abort.signal);
    abort.abort(new Error('enough'));
    await expect(given).rejects.toThrow('enough');
    await settled();
    expect(loading[0].signal.aborted).toBe(true);
    const again = cache.get(3);
    loading[1].finish();
    expect((await again).first).toBe(3);
  });

  it('loads one block ahead at a time', async () => {
    const { cache, loading } = setUp();
    cache.prefetch(1);
    cache.prefetch(2);
    expect(loading.map(({ first, signal }) => [first, signal.aborted])).toEqual([
      [1, true],
      [2, false],
    ]);
    const wanted = cache.get(2);
    loading[1].finish();
    expect((await wanted).first).toBe(2);
    expect(loading.length).toBe(2);
  });

  it('tells a failure to those who wait, and tries again for the next', async () => {
    const { cache, loading } = setUp();
    const first = cache.get(3);
    loading[0].fail(new Error('no'));
    await expect(first).rejects.toThrow('no');
    const second = cache.get(3);
    loading[1].finish();
    expect((await second).first).toBe(3);
  });

  it('lets go of the blocks used longest ago', async () => {
    const { cache, loading } = setUp();
    for (const first of [0, 1, 0, 2]) {
      const block = cache.get(first);
      loading.at(-1)?.finish();
      await block;
    }
    void cache.get(0);
    void cache.get(2);
    void cache.get(1);
    expect(loading.map(({ first }) => first)).toEqual([0, 1, 2, 1]);
  });
});
