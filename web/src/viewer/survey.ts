import type { Capture } from '../capture';
import type { Motion } from '../render/motion';

/** Frames that are looked at, evenly spread: the blocks around them are all there is of most captures. */
const FRAMES = 32;
/** How long to wait for what is played. */
const WAIT_MILLISECONDS = 200;

/**
 * Reads frames of a finished capture for what they say of its motion, one block after another, as long as the connection has time for them. Those that do not
 * come are left to whoever plays them.
 *
 * @param isBusy whether something waits for frames that are to be shown
 */
export async function surveyMotion(
  capture: Capture,
  motion: Motion,
  isBusy: () => boolean,
  signal: AbortSignal,
): Promise<void> {
  if (!capture.complete) return;
  const last = capture.frames - 1;
  const wanted = new Set(Array.from({ length: FRAMES }, (_, k) => Math.round((k * last) / (FRAMES - 1))));
  for (const frame of wanted) {
    while (isBusy() && !signal.aborted) await new Promise((resolve) => setTimeout(resolve, WAIT_MILLISECONDS));
    if (signal.aborted) return;
    if (motion.knows(frame)) continue;
    try {
      motion.include(await capture.block(frame, signal));
    } catch {
      continue;
    }
  }
}
