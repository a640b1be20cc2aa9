import { numberAt, placeOf, type FrameNumbers } from './frameNumbers';

/** What happens at the end: it stops there, begins anew, or plays back to the beginning and on again. */
export type Repeat = 'once' | 'loop' | 'ping-pong';
export const REPEATS: readonly Repeat[] = ['once', 'loop', 'ping-pong'];

export interface Transport {
  readonly playing: boolean;
  readonly repeat: Repeat;
  /** 1 forwards, −1 on the way back of a ping-pong. */
  readonly direction: 1 | -1;
  /** First and last frame that are played; null where all are. */
  readonly range: readonly [number, number] | null;
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
  /** Whether it stays near the newest frame while more come, until somebody pauses, or goes elsewhere. */
  readonly live: boolean;
}

export const SPEEDS = [0.1, 0.25, 0.5, 1, 1.5, 2, 4] as const;
/** Where nothing says how many frames a second were captured. */
export const USUAL_RATE = 30;

export function standing(): Transport {
  return {
    playing: false,
    repeat: 'loop',
    direction: 1,
    range: null,
    smooth: true,
    speed: 1,
    rate: USUAL_RATE,
    position: 0,
    frames: 0,
    numbers: null,
    complete: true,
    live: false,
  };
}

/** Frames and seconds that playing keeps from the newest frame, the fewer of both, so that it does not wait for every one. */
const [MARGIN_FRAMES, MARGIN_SECONDS] = [15, 1];

/** The frame from which a running session is played live. */
export function liveFrame({ frames, rate }: Transport): number {
  return Math.max(0, frames - 1 - Math.min(MARGIN_FRAMES, Math.floor(MARGIN_SECONDS * rate)));
}

/** Plays a running session near its newest frame. */
export function liveAgain(transport: Transport): Transport {
  return { ...started(sought(transport, liveFrame(transport))), live: true };
}

export function playedFrames({ range, frames }: Transport): readonly [number, number] {
  const last = Math.max(0, frames - 1);
  return range ? [Math.min(range[0], last), Math.min(range[1], last)] : [0, last];
}

/** Whether playing has an end to return from: a capture that is still growing has none, unless a part of it is played. */
function repeats({ repeat, complete, range }: Transport): boolean {
  return repeat !== 'once' && (complete || range !== null);
}

/**
 * Moves on by some seconds; numbers that are missing between two frames take their time. At the end of a capture it repeats or stops; at the end of one that is
 * still growing it waits there.
 * Where that grows faster than it is played, a live picture goes on near the newest frame.
 */
export function advanced(transport: Transport, seconds: number): Transport {
  if (!transport.playing || transport.frames === 0) return transport;
  const { numbers, direction, repeat } = transport;
  const [first, last] = playedFrames(transport);
  const [begin, end] = [first, last].map((frame) => numberAt(numbers, frame));
  const number = numberAt(numbers, transport.position) + direction * seconds * transport.rate * transport.speed;
  const at = (reached: number, way = direction): Transport => ({
    ...transport,
    position: placeOf(numbers, Math.min(end, Math.max(begin, reached))),
    direction: way,
  });
  if (!repeats(transport)) {
    const { live, speed } = transport;
    const newest = live && speed >= 1 ? numberAt(numbers, liveFrame(transport)) : begin;
    if (number < end) return at(Math.max(number, newest));
    return { ...transport, position: last, playing: !transport.complete && transport.range === null };
  }
  if (repeat === 'ping-pong') {
    if (number > end) return at(2 * end - number, -1);
    return number < begin ? at(2 * begin - number, 1) : at(number);
  }
  // In a loop the last frame is shown as long as any other.
  const length = numberAt(numbers, last + 1) - begin;
  const along = (((number - begin) % length) + length) % length;
  return { ...transport, position: first === last ? first : placeOf(numbers, begin + along), direction: 1 };
}

/** Begins or ends the played part at the frame that is shown; takes that back where it does so already. */
export function ranged(transport: Transport, end: 'in' | 'out'): Transport {
  const here = Math.round(transport.position);
  const all = [0, transport.frames - 1] as const;
  const [first, last] = transport.range ?? all;
  const next =
    end === 'in'
      ? ([here === first ? 0 : here, here > last ? all[1] : last] as const)
      : ([here < first ? 0 : first, here === last ? all[1] : here] as const);
  return { ...transport, range: next[0] === 0 && next[1] === all[1] ? null : next };
}

/** Goes to a frame, to the nearest one that exists. */
export function sought(transport: Transport, position: number): Transport {
  const last = Math.max(0, transport.frames - 1);
  const place = Math.min(last, Math.max(0, Number.isFinite(position) ? position : 0));
  return { ...transport, position: place, live: false };
}

/** Goes some whole frames on, around the ends where it loops, and stands there. */
export function stepped(transport: Transport, frames: number): Transport {
  const standing = { ...transport, playing: false, live: false };
  const to = Math.round(transport.position) + frames;
  const count = transport.frames;
  return transport.repeat !== 'once' && transport.complete && count > 0
    ? { ...standing, position: ((to % count) + count) % count }
    : sought(standing, to);
}

/** Begins to play: from the first frame where it stands outside of those that are played, or at the last one and nothing follows. */
export function started(transport: Transport): Transport {
  const { position, range, complete } = transport;
  const [first, last] = playedFrames(transport);
  const atEnd = (complete || range !== null) && position >= last && !repeats(transport);
  const isOutside = range !== null && (position < first || position >= last + 1);
  return { ...transport, playing: true, position: atEnd || isOutside ? first : position };
}

export function spedUp(transport: Transport, steps: number): Transport {
  const at = SPEEDS.findIndex((speed) => speed >= transport.speed);
  const next = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, (at < 0 ? SPEEDS.length - 1 : at) + steps))];
  return { ...transport, speed: next };
}

/** The frame before a place, the one after it, and how much the latter counts. After the last frame that is played comes none. */
export function framesAround(transport: Transport): {
  readonly before: number;
  readonly after: number;
  readonly mix: number;
} {
  const before = Math.min(Math.max(0, transport.frames - 1), Math.floor(transport.position));
  const [, last] = playedFrames(transport);
  const after = before === last ? before : Math.min(Math.max(0, transport.frames - 1), before + 1);
  return { before, after, mix: after === before || !transport.smooth ? 0 : transport.position - before };
}

/** Frames that will be shown soon, the nearest first. */
export function* framesAhead(transport: Transport, count: number): Generator<number> {
  const [first, last] = playedFrames(transport);
  let [frame, way]: [number, number] = [Math.floor(transport.position), transport.direction];
  for (let k = 0; k < Math.min(count, transport.frames) && frame >= 0 && frame < transport.frames; k++) {
    yield frame;
    if (frame === (way > 0 ? last : first)) {
      if (!repeats(transport)) return;
      if (transport.repeat === 'loop') frame = first - 1;
      else way = -way;
    }
    frame += way;
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
