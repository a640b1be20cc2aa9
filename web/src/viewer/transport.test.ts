import { describe, expect, it } from 'vitest';
import {
  advanced,
  framesAhead,
  framesAround,
  liveAgain,
  ranged,
  sought,
  spedUp,
  standing,
  started,
  stepped,
  worstFrame,
} from './transport';

const playing = { ...standing(), playing: true, frames: 10 };

describe('transport', () => {
  it('plays at the captured rate times the speed', () => {
    expect(advanced({ ...playing, rate: 24, speed: 0.5 }, 0.25).position).toBeCloseTo(3);
  });

  it('begins anew at the end of a loop, and stays within the frames', () => {
    const after = advanced({ ...playing, position: 9.5 }, 0.1);
    expect(after.playing).toBe(true);
    expect(after.position).toBeCloseTo(2.5);
    expect(advanced({ ...playing, frames: 1 }, 5).position).toBe(0);
    expect(advanced({ ...playing, frames: 0 }, 5).position).toBe(0);
  });

  it('stops at the last frame without a loop, and begins anew from there', () => {
    const ended = advanced({ ...playing, repeat: 'once' }, 60);
    expect(ended).toMatchObject({ position: 9, playing: false });
    expect(started(ended).position).toBe(0);
  });

  it('waits at the end of a capture that is still growing, and goes on when more comes', () => {
    const waiting = advanced({ ...playing, complete: false }, 60);
    expect(waiting).toMatchObject({ position: 9, playing: true });
    expect(advanced({ ...waiting, frames: 20 }, 0.1).position).toBeCloseTo(12);
  });

  it('stays at the newest frames of a live picture however fast they come, until somebody goes elsewhere', () => {
    let live = liveAgain({ ...playing, complete: false, frames: 100 });
    for (let k = 0; k < 50; k++) live = advanced({ ...live, frames: live.frames + 20 }, 0.1);
    expect(live.frames - live.position).toBeLessThan(17);
    const left = advanced({ ...sought(live, 500), frames: 5000 }, 0.1);
    expect(left.position).toBeCloseTo(503);
    expect(advanced({ ...live, speed: 0.5, frames: 5000 }, 0.1).position).toBeLessThan(live.frames);
  });

  it('steps whole frames, around the ends of a loop', () => {
    expect(stepped({ ...playing, position: 0.2 }, -1)).toMatchObject({ position: 9, playing: false });
    expect(stepped({ ...playing, position: 9 }, 1).position).toBe(0);
    expect(stepped({ ...playing, position: 9, repeat: 'once' }, 1).position).toBe(9);
  });

  it('seeks only what exists', () => {
    expect(sought(playing, 99).position).toBe(9);
    expect(sought(playing, -3).position).toBe(0);
    expect(sought(playing, NaN).position).toBe(0);
  });

  it('changes the speed in steps, within bounds', () => {
    expect(spedUp(playing, 1).speed).toBe(1.5);
    expect(spedUp(playing, -99).speed).toBe(0.1);
    expect(spedUp({ ...playing, speed: 99 }, 1).speed).toBe(4);
  });

  it('blends neighbouring frames, but never the last one with the first', () => {
    expect(framesAround({ ...playing, position: 3.25 })).toEqual({ before: 3, after: 4, mix: 0.25 });
    expect(framesAround({ ...playing, position: 9.75 })).toEqual({ before: 9, after: 9, mix: 0 });
  });

  it('looks ahead around the end of a loop, each frame once', () => {
    expect([...framesAhead({ ...playing, position: 8.5 }, 4)]).toEqual([8, 9, 0, 1]);
    expect([...framesAhead({ ...playing, position: 8.5, repeat: 'once' }, 4)]).toEqual([8, 9]);
    expect([...framesAhead(playing, 99)]).toHaveLength(10);
  });

  it('plays back and forth, and only the part between in and out', () => {
    const back = advanced({ ...playing, repeat: 'ping-pong', position: 8.5 }, 0.05);
    expect(back).toMatchObject({ position: 8, direction: -1 });
    expect(advanced({ ...back, position: 1 }, 0.1)).toMatchObject({ position: 2, direction: 1 });
    expect([...framesAhead({ ...back, position: 1.5 }, 4)]).toEqual([1, 0, 1, 2]);
    const part = ranged(ranged({ ...playing, position: 3 }, 'in'), 'in').range;
    expect(part).toBeNull();
    const within = ranged({ ...ranged({ ...playing, position: 3 }, 'in'), position: 5 }, 'out');
    expect(within.range).toEqual([3, 5]);
    expect(advanced({ ...within, position: 5.5 }, 0.05).position).toBe(4);
    expect(framesAround({ ...within, position: 5.5 })).toEqual({ before: 5, after: 5, mix: 0 });
    expect([...framesAhead({ ...within, position: 4 }, 4)]).toEqual([4, 5, 3, 4]);
    expect(advanced({ ...within, repeat: 'once' }, 0.1)).toMatchObject({ position: 5, playing: false });
    expect(started({ ...within, playing: false, position: 9 }).position).toBe(3);
  });

  it('finds the worst frame among those that were measured', () => {
    expect(worstFrame(Float32Array.of(NaN, 0.1, 0.3, NaN, 0.2))).toBe(2);
    expect(worstFrame(Float32Array.of(NaN))).toBeNull();
  });
});
