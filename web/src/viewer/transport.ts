import { numberAt, placeOf, type FrameNumbers } from './frameNumbers';

/** What plays: where, how fast, and what happens at the end. */
export interface Transport {
  readonly playing: boolean;
  readonly loop: boolean;
  /** Whether frames are blended into each other, or each stands until the next one. */
  readonly smooth: boolean;
  /** 1 plays as fast as it was captured. */
  readonly speed: number;
  /** Frames per second at speed 1. */
  readonly rate: number;
  /** Frame, or a place between two frames: 2.5 is halfway from frame 2 to frame 3. */
  readonly position: number;
  readonly frames: number;
  /** Numbers of the frames, by which they are shown. */
  readonly numbers: FrameNumbers;
  /** Whether no more will come. */
  readonly complete: boolean;
}

export const SPEEDS = [0.1, 0.25, 0.5, 1, 1.5, 2, 4] as const;
/** Where nothing says how many frames a second were captured. */
export const USUAL_RATE = 30;

/** A transport that stands at the first frame. */
export function standing(): Transport {
  return {
    playing: false,
    loop: true,
    smooth: true,
    speed: 1,
    rate: USUAL_RATE,
    position: 0,
    frames: 0,
    numbers: null,
    complete: true,
  };
}

/**
 * Moves on by some seconds; numbers that are missing between two frames take their time. At the end of a capture it begins anew or stops; at the end of one
 * that is still growing it waits there.
 */
export function advanced(transport: Transport, seconds: number): Transport {
  if (!transport.playing || transport.frames === 0) return transport;
  const { frames, numbers, complete, loop } = transport;
  const begin = numberAt(numbers, 0);
  const number = numberAt(numbers, transport.position) + seconds * transport.rate * transport.speed;
  // Without a loop nothing lies between the last frame and the first one.
  const end = numberAt(numbers, complete && loop ? frames : frames - 1);
  if (number < end) return { ...transport, position: placeOf(numbers, number) };
  if (!complete) return { ...transport, position: Math.max(0, frames - 1) };
  if (loop)
    return { ...transport, position: frames > 1 ? placeOf(numbers, begin + ((number - begin) % (end - begin))) : 0 };
  return { ...transport, position: frames - 1, playing: false };
}

/** Goes to a frame, to the nearest one that exists. */
export function sought(transport: Transport, position: number): Transport {
  const last = Math.max(0, transport.frames - 1);
  return { ...transport, position: Math.min(last, Math.max(0, Number.isFinite(position) ? position : 0)) };
}

/** Goes some whole frames on, around the ends where it loops, and stands there. */
export function stepped(transport: Transport, frames: number): Transport {
  const standing = { ...transport, playing: false };
  const to = Math.round(transport.position) + frames;
  const count = transport.frames;
  return transport.loop && transport.complete && count > 0
    ? { ...standing, position: ((to % count) + count) % count }
    : sought(standing, to);
}

/** Begins to play, from the first frame if it stands at the last one and nothing follows. */
export function started(transport: Transport): Transport {
  const atEnd = transport.complete && transport.position >= transport.frames - 1;
  return { ...transport, playing: true, position: atEnd && !transport.loop ? 0 : transport.position };
}

/** The next slower or faster speed. */
export function spedUp(transport: Transport, steps: number): Transport {
  const at = SPEEDS.findIndex((speed) => speed >= transport.speed);
  const next = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, (at < 0 ? SPEEDS.length - 1 : at) + steps))];
  return { ...transport, speed: next };
}

/** The frame before a place, the one after it, and how much the latter counts. After the last frame comes none. */
export function framesAround(transport: Transport): {
  readonly before: number;
  readonly after: number;
  readonly mix: number;
} {
  const before = Math.min(Math.max(0, transport.frames - 1), Math.floor(transport.position));
  const after = Math.min(Math.max(0, transport.frames - 1), before + 1);
  return { before, after, mix: after === before || !transport.smooth ? 0 : transport.position - before };
}

/** Frames that will be shown soon, the nearest first. */
export function* framesAhead(transport: Transport, count: number): Generator<number> {
  const first = Math.floor(transport.position);
  for (let k = 0; k < Math.min(count, transport.frames); k++) {
    const frame = first + k;
    if (frame < transport.frames) yield frame;
    else if (transport.loop && transport.complete) yield frame - transport.frames;
    else return;
  }
}

/** The frame with the largest number that counts, or null where none does. */
export function worstFrame(errors: Float32Array): number | null {
  let worst: number | null = null;
  for (let k = 0; k < errors.length; k++) {
    if (Number.isFinite(errors[k]) && (worst === null || errors[k] > errors[worst])) worst = k;
  }
  return worst;
}
