import { numberAt, numberText } from './frameNumbers';
import type { Player } from './player';
import { isLost } from './reports';
import { clock, percent } from '../text';

/**
 * Writes frame, time and errors of the place that is shown. Rendering the template sixty times a second would cost more.
 *
 * @param isEdited whether the frame is shown with edits: what was measured is not what is shown then
 */
export function writeReadout(root: ParentNode, { capture, transport }: Player, isEdited: (frame: number) => boolean) {
  const write = (selector: string, text: string) => {
    const place = root.querySelector(selector);
    if (place && place.textContent !== text) place.textContent = text;
  };
  const last = Math.max(0, capture.frames - 1);
  const frame = Math.min(Math.floor(transport.position), last);
  const [first, number, end] = [0, frame, last].map((place) => numberAt(transport.numbers, place));
  write('[data-place]', `${numberText(number)} / ${numberText(end)}`);
  write('[data-clock]', clock((number - first) / transport.rate));
  const hidden = isEdited(frame);
  const figure = (value: number | undefined) =>
    value === undefined || !Number.isFinite(value) || hidden ? '–' : percent(value);
  write(
    '[data-score]',
    figure(capture.tracking?.scores[frame]) + (capture.tracking && isLost(capture.tracking, frame) ? ' lost' : ''),
  );
  write('[data-l2]', figure(capture.errors.l2[frame]));
  write('[data-linf]', figure(capture.errors.linf[frame]));
}
