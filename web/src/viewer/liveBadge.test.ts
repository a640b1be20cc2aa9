import { expect, test } from 'vitest';
import type { LiveStatus } from '../capture';
import { livePlace } from './liveBadge';
import { liveFrame, standing } from './transport';

const following: LiveStatus = {
  state: 'following',
  retryAt: null,
  latencySeconds: null,
  missingFrame: null,
  codedFrames: null,
  behindFrames: 0,
  bitsPerSecond: 0,
  framesPerSecond: 10,
  lateFrames: 0,
  droppedFrames: 0,
};
const playing = { ...standing(), playing: true, complete: false, frames: 40, rate: 10, position: 35 };

test('a_picture_is_live_while_it_plays_within_seconds_of_the_newest_frame', () => {
  expect(livePlace(following, playing, 0)).toEqual({ kind: 'live' });
  expect(livePlace(following, { ...playing, position: 9 }, 0)).toEqual({ kind: 'behind', behind: 3 });
  expect(livePlace({ ...following, behindFrames: 30 }, playing, 0)).toEqual({ kind: 'behind', behind: 3.4 });
  expect(livePlace(following, { ...playing, playing: false }, 0).kind).toBe('behind');
});

test('a_picture_waits_at_the_newest_frame_where_none_come', () => {
  const quiet = { ...following, framesPerSecond: 0 };
  expect(livePlace(quiet, playing, 0)).toEqual({ kind: 'waiting', missing: null });
  expect(livePlace({ ...quiet, missingFrame: 40 }, playing, 0)).toEqual({ kind: 'waiting', missing: 40 });
  expect(livePlace(quiet, { ...playing, position: 9 }, 0)).toEqual({ kind: 'behind', behind: 3 });
});

test('nothing_is_live_while_the_service_does_not_answer', () => {
  const reconnecting = { ...following, state: 'reconnecting', retryAt: 5000 } as const;
  expect(livePlace(reconnecting, playing, 2600)).toEqual({ kind: 'reconnecting', retry: 3 });
  expect(livePlace(reconnecting, playing, 6000)).toEqual({ kind: 'reconnecting', retry: 0 });
  expect(livePlace({ ...following, state: 'signed-out' }, playing, 0)).toEqual({ kind: 'signed-out' });
});

test('going_live_arrives_where_the_picture_is_live', () => {
  for (const rate of [1, 5, 24, 120]) {
    for (const frames of [1, 20, 900]) {
      const transport = { ...playing, rate, frames };
      expect(livePlace(following, { ...transport, position: liveFrame(transport) }, 0)).toEqual({ kind: 'live' });
    }
  }
});
