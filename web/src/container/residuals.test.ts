import { afterEach, expect, test, vi } from 'vitest';
import { goldenBytes, openBytes } from './testSupport';
import { MeteredSource } from './residuals';
import { bytesSource, type Source } from './source';

afterEach(() => vi.useRealTimers());

test('blocks_are_read_without_their_residual_while_it_is_left_out_and_again_with_it', async () => {
  const capture = await openBytes(goldenBytes('coded-mvc'));
  const residuals = capture.residuals!;
  expect(residuals.bytes).toBeGreaterThan(0);
  let replaced = 0;
  capture.events.addEventListener('replaced', () => replaced++);
  residuals.leftOut = true;
  const alone = await capture.block(0);
  expect(alone.residual).toBeNull();
  residuals.leftOut = false;
  expect(replaced).toBe(1);
  const complete = await capture.block(0);
  expect(complete.residual).not.toBeNull();
  expect(complete.cages).toEqual(alone.cages);
  // Nothing is read again where nothing was left out.
  residuals.leftOut = true;
  residuals.leftOut = false;
  expect(replaced).toBe(1);
  capture.close();
});

test('a_container_without_residuals_has_none_to_leave_out', async () => {
  const capture = await openBytes(goldenBytes('definition3-mvc'));
  expect(capture.residuals).toBeNull();
  capture.close();
});

test('a_rate_is_of_the_time_in_which_something_was_read', async () => {
  vi.useFakeTimers();
  const bytes = bytesSource(new Uint8Array(1000));
  const slow: Source = {
    size: 1000,
    read: async (offset, length) => {
      await new Promise((resolve) => setTimeout(resolve, length));
      return bytes.read(offset, length);
    },
  };
  const metered = new MeteredSource(slow);
  const read = async (...lengths: number[]) => {
    const reads = lengths.map((length) => metered.read(0, length));
    await vi.runAllTimersAsync();
    await Promise.all(reads);
  };
  await read(400);
  expect(metered.bytesPerSecond).toBeNull();
  await vi.advanceTimersByTimeAsync(10_000);
  await read(400);
  expect(metered.bytesPerSecond).toBeCloseTo(1000, 6);
  // Two at once share the time.
  await read(800, 800);
  expect(metered.bytesPerSecond).toBeCloseTo(1500, 6);
});
