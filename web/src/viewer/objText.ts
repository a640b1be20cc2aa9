import type { StaticPart } from '../capture';

/** A model with these points, x y z each, as Wavefront text; where the capture lies far away it is put there. */
export function objOf(part: Pick<StaticPart, 'cornerCounts' | 'corners' | 'origin'>, positions: Float32Array): string {
  const { cornerCounts, corners, origin } = part;
  const lines: string[] = [];
  const place = (x: number, k: number) => (origin ? x + origin[k % 3] : Number(x.toPrecision(9)));
  for (let at = 0; at < positions.length; at += 3)
    lines.push(`v ${place(positions[at], 0)} ${place(positions[at + 1], 1)} ${place(positions[at + 2], 2)}`);
  let first = 0;
  for (const count of cornerCounts) {
    lines.push(`f ${Array.from(corners.subarray(first, first + count), (corner) => corner + 1).join(' ')}`);
    first += count;
  }
  return lines.join('\n') + '\n';
}
