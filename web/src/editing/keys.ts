import { rotationAbout, type Motion, type MotionKind } from './motion';
import { plus, type Vector } from '../coordinates/vector';
import type { Projection } from '../render/projection';

/** What a key press asks for while a cage is edited. Directions are those of the picture. */
export type KeyCommand =
  | { readonly kind: 'undo' | 'redo' | 'clear' | 'leave' | 'enter' }
  | { readonly kind: 'step'; readonly by: 1 | -1 }
  | { readonly kind: 'tool'; readonly tool: MotionKind }
  /** The vertex beside the chosen one; y points down. */
  | { readonly kind: 'towards'; readonly x: number; readonly y: number }
  | {
      readonly kind: 'nudge';
      readonly right: number;
      readonly up: number;
      readonly away: number;
      /** With shift: farther at once. */
      readonly isLong: boolean;
    };

/** Letters that choose what is done; none of them is one of the viewer's shortcuts. */
export const TOOL_KEYS: Readonly<Record<MotionKind, string>> = { move: 'q', rotate: 'r', scale: 'u' };

/** Pixels, radians and factors of one press of an arrow key, alone and with shift. */
const [STEP, LONG_STEP] = [4, 32];
const [TURN, LONG_TURN] = [Math.PI / 90, Math.PI / 12];
const [GROWTH, LONG_GROWTH] = [1.02, 1.1];
/** Right, up and away for each key that moves. */
const WAYS: Readonly<Record<string, readonly [number, number, number]>> = {
  ArrowLeft: [-1, 0, 0],
  ArrowRight: [1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  PageUp: [0, 0, 1],
  PageDown: [0, 0, -1],
};

type Key = Pick<KeyboardEvent, 'key' | 'shiftKey' | 'ctrlKey' | 'altKey' | 'metaKey'>;

/**
 * What a key press asks for, null for nothing that has to do with editing. Tab chooses the next vertex only while one is chosen: after Escape it leads on
 * through the page as ever.
 */
export function keyCommand(
  event: Key,
  { isInPicture, hasSelection }: { isInPicture: boolean; hasSelection: boolean },
): KeyCommand | null {
  const { key, shiftKey, altKey } = event;
  if (event.ctrlKey || event.metaKey) {
    const letter = key.toLowerCase();
    if (letter === 'y' || (letter === 'z' && shiftKey)) return { kind: 'redo' };
    return letter === 'z' ? { kind: 'undo' } : null;
  }
  if (key === 'Escape') return { kind: hasSelection ? 'clear' : 'leave' };
  if (!isInPicture) return null;
  if (key === 'Tab' && hasSelection) return { kind: 'step', by: shiftKey ? -1 : 1 };
  if (key === 'Enter' && !hasSelection) return { kind: 'enter' };
  const tool = (Object.keys(TOOL_KEYS) as MotionKind[]).find((kind) => TOOL_KEYS[kind] === key.toLowerCase());
  if (tool && !altKey) return { kind: 'tool', tool };
  if (!Object.hasOwn(WAYS, key)) return null;
  const [right, up, away] = WAYS[key];
  if (!hasSelection) return key.startsWith('Arrow') ? { kind: 'enter' } : null;
  if (altKey) return away === 0 ? { kind: 'towards', x: right, y: -up } : null;
  return { kind: 'nudge', right, up, away, isLong: shiftKey };
}

/**
 * What one press of an arrow key does: moves in that direction, rotates the front of what is chosen in that direction (Page ↑ clockwise), or makes it
 * larger upwards and to the right and smaller the other way.
 *
 * @param at the pivot, in the scene's unit
 * @param diagonal length of the scene's unit, in the capture's
 */
export function keyMotion(
  kind: MotionKind,
  { right, up, away, isLong }: KeyCommand & { kind: 'nudge' },
  projection: Projection,
  at: Vector,
  diagonal: number,
): Motion {
  const axes = projection.axes(at);
  if (kind === 'scale') {
    const factor = (isLong ? LONG_GROWTH : GROWTH) ** (right + up + away);
    return { kind, factors: [factor, factor, factor] };
  }
  if (kind === 'rotate') {
    const axis = plus(plus(plus([0, 0, 0], axes.up, right), axes.right, -up), axes.away, away);
    return { kind, rotation: rotationAbout(axis, isLong ? LONG_TURN : TURN) };
  }
  const way = plus(plus(plus([0, 0, 0], axes.right, right), axes.up, up), axes.away, away);
  const length = (isLong ? LONG_STEP : STEP) * projection.unitsPerPixel(at) * diagonal;
  return { kind, by: [way[0] * length, way[1] * length, way[2] * length] };
}
