import type { Capture } from '../capture';
import { boundsOf } from '../coordinates/topology';
import type { Player } from './player';

/** Darkest and brightest value of a colour's channels: light and shadow are seen on all. */
const [DARK, BRIGHT] = [40, 245];

/**
 * Paints a source by the places of its points at rest, and a target with the colours of the points that correspond to its own. Either may be the source; of two
 * with as many points it is the first.
 *
 * @param correspondence the source's point for each of the target's
 * @throws Error with one sentence for a person where it is not of these two
 */
export function paintCorrespondence(correspondence: readonly number[], first: Player, second: Player) {
  const pointsOf = ({ capture }: Player) => capture.static.rest.length / 3;
  const [source, target] = pointsOf(second) === correspondence.length ? [first, second] : [second, first];
  const count = pointsOf(source);
  if (pointsOf(target) !== correspondence.length || correspondence.some((point) => point >= count)) {
    throw new Error('This report is about other models: open the source and the transferred target.');
  }
  const colors = placeColors(source.capture.static);
  const taken = new Uint8Array(3 * correspondence.length);
  for (const [k, point] of correspondence.entries()) taken.set(colors.subarray(3 * point, 3 * point + 3), 3 * k);
  source.stage.paint(colors);
  target.stage.paint(taken);
}

/** Red, green and blue of each point by where it is between the ends of the model: along x, y and z. */
export function placeColors({ rest }: Pick<Capture['static'], 'rest'>): Uint8Array {
  const { low, high } = boundsOf(rest);
  return Uint8Array.from(rest, (x, k) => {
    const share = (x - low[k % 3]) / (high[k % 3] - low[k % 3] || 1);
    return Math.round(DARK + (BRIGHT - DARK) * share);
  });
}
