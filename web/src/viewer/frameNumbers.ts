/**
 * Numbers of frames where they come from (`fnum` in docs/FORMAT.md), which say when each is shown: a frame's time is its number over the frame rate. Places in
 * a capture count its frames: 2.5 is halfway from frame 2 to frame 3. Without numbers, frame k has the number k.
 */

/** Ascending numbers of all frames; null where they count from 0. */
export type FrameNumbers = Float64Array | null;

/** The number that belongs to a place; the last frame is shown as long as one number, or as the one before it where that is shorter. */
export function numberAt(numbers: FrameNumbers, place: number): number {
  if (!numbers || numbers.length === 0) return place;
  const last = numbers.length - 1;
  const frame = Math.min(last, Math.max(0, Math.floor(place)));
  const next = frame < last ? numbers[frame + 1] : numbers[last] + lastStep(numbers);
  return numbers[frame] + (place - frame) * (next - numbers[frame]);
}

/** The place of a number, the first or the last frame where it lies outside of the capture; what {@link numberAt} returns is taken back. */
export function placeOf(numbers: FrameNumbers, number: number): number {
  if (!numbers || numbers.length === 0) return number;
  let [low, high] = [0, numbers.length - 1];
  if (number >= numbers[high]) return high + Math.min(1, (number - numbers[high]) / lastStep(numbers));
  if (number <= numbers[0]) return 0;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= number) low = middle;
    else high = middle;
  }
  return low + (number - numbers[low]) / (numbers[high] - numbers[low]);
}

/** The number of a frame as it is shown. */
export function frameText(numbers: FrameNumbers, frame: number): string {
  return numberText(numberAt(numbers, frame));
}

/** Frames from one to another, by their numbers. */
export function rangeText(numbers: FrameNumbers, first: number, last: number): string {
  return first === last ? frameText(numbers, first) : `${frameText(numbers, first)}–${frameText(numbers, last)}`;
}

export function numberText(number: number): string {
  return String(Number(number.toFixed(3)));
}

function lastStep(numbers: Float64Array): number {
  const last = numbers.length - 1;
  return last > 0 ? Math.min(1, numbers[last] - numbers[last - 1]) : 1;
}
