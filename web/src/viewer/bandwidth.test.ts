import { expect, test } from 'vitest';
import type { Capture } from '../capture';
import { followBandwidth } from './bandwidth';
import { standing } from './transport';

/** A capture of 100 frames of 1,000 bytes that arrives at this rate. */
function arriving(bytesPerSecond: number | null) {
  const residuals = { leftOut: false, bytes: 60_000, bytesPerSecond };
  const follow = (transport: Partial<ReturnType<typeof standing>>) => {
    followBandwidth({ residuals, frameBytes: 100_000, frames: 100 } as unknown as Capture, {
      ...standing(),
      ...transport,
    });
    return residuals.leftOut;
  };
  return follow;
}

test('residuals_are_left_out_while_a_capture_plays_that_arrives_too_slowly_and_come_when_it_stands', () => {
  const follow = arriving(20_000);
  expect(follow({ playing: false })).toBe(false);
  expect(follow({ playing: true, rate: 30, speed: 0.5 })).toBe(false);
  expect(follow({ playing: true, rate: 30 })).toBe(true);
  expect(follow({ playing: true, rate: 30, speed: 0.5 })).toBe(true);
  expect(follow({ playing: false })).toBe(false);
});

test('residuals_are_kept_while_nothing_is_known_of_the_connection', () => {
  expect(arriving(null)({ playing: true })).toBe(false);
});
