/** What a key press asks for while a cage is edited. Directions are those of the picture. */
export type KeyCommand =
  | { readonly kind: 'undo' | 'redo' | 'clear' | 'leave' | 'enter' }
  /** The next or the previous vertex by number. */
  | { readonly kind: 'step'; readonly by: 1 | -1 }
  /** The vertex beside the chosen one; y points down. */
  | { readonly kind: 'towards'; readonly x: number; readonly y: number }
  | {
      readonly kind: 'nudge';
      readonly right: number;
      readonly up: number;
      readonly away: number;
      readonly pixels: number;
    };

/** Pixels of one press of an arrow key, alone and with shift. */
const [STEP, LONG_STEP] = [4, 32];
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
  if (!Object.hasOwn(WAYS, key)) return null;
  const [right, up, away] = WAYS[key];
  if (!hasSelection) return key.startsWith('Arrow') ? { kind: 'enter' } : null;
  if (altKey) return away === 0 ? { kind: 'towards', x: right, y: -up } : null;
  return { kind: 'nudge', right, up, away, pixels: shiftKey ? LONG_STEP : STEP };
}
