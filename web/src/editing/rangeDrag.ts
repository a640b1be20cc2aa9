import { fitted, type FrameRange } from './cageEdit';

/** What of a range is dragged: an end, where an ease ends, or all of it. */
export type RangePart = 'first' | 'last' | 'easeIn' | 'easeOut' | 'whole';

/** The range after a part of it was dragged by some frames, in a capture of so many. */
export function draggedRange(part: RangePart, range: FrameRange, by: number, frames: number): FrameRange {
  const { first, last, easeIn, easeOut } = range;
  const within = (value: number, least: number, most: number) => Math.min(most, Math.max(least, value));
  const moved = (): FrameRange => {
    switch (part) {
      case 'first': {
        const begun = within(first + by, 0, last);
        // The nearer ease gives way first.
        return { ...range, first: begun, easeIn: within(easeIn, 0, Math.max(0, last - begun - easeOut)) };
      }
      case 'last': {
        const ended = within(last + by, first, frames - 1);
        return { ...range, last: ended, easeOut: within(easeOut, 0, Math.max(0, ended - first - easeIn)) };
      }
      case 'easeIn':
        return { ...range, easeIn: within(easeIn + by, 0, last - first - easeOut) };
      case 'easeOut':
        return { ...range, easeOut: within(easeOut - by, 0, last - first - easeIn) };
      case 'whole': {
        const way = within(by, -first, frames - 1 - last);
        return { ...range, first: first + way, last: last + way };
      }
    }
  };
  return fitted(moved(), frames);
}

/**
 * The part of a range that is pointed at.
 *
 * @param x where, and `reach` how far from a handle that may be, as `placeOf` gives the places of frames
 * @param isUpper whether in the half where eases end
 * @param way where it is dragged to, which says what is meant of two handles in one place; before that, the side that is pointed at does
 */
export function partAt(
  range: FrameRange,
  x: number,
  isUpper: boolean,
  reach: number,
  placeOf: (frame: number) => number,
  way = 0,
): RangePart | null {
  const { first, last, easeIn, easeOut } = range;
  const handles: readonly (readonly [RangePart, number])[] = isUpper
    ? [
        ['easeIn', first + easeIn],
        ['easeOut', last - easeOut],
      ]
    : [
        ['first', first],
        ['last', last],
      ];
  const away = (frame: number) => Math.abs(x - placeOf(frame));
  const near = handles.filter(([, frame]) => away(frame) <= reach);
  // Of two in one place, the one on the side that is pointed at can be pulled there.
  if (near.length === 2) {
    const [[, left], [, right]] = near;
    const isRight = left === right ? (way || x - placeOf(left)) > 0 : away(right) < away(left);
    return near[isRight ? 1 : 0][0];
  }
  if (near.length === 1) return near[0][0];
  return x >= placeOf(first) - reach && x <= placeOf(last) + reach ? 'whole' : null;
}
