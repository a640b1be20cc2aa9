import { Vector2, type WebGLRenderer } from 'three';
import type { Side } from './drawn';

/** Draws the side of a picture that is asked for; both meet at a line, at `split` of the picture's width. */
export function drawSide(
  renderer: WebGLRenderer,
  side: Side,
  split: number,
  drawDecoded: () => void,
  drawOriginal: () => void,
  drawGhost: () => void,
) {
  if (side === 'decoded' || side === 'ghost') drawDecoded();
  if (side === 'ghost') drawGhost();
  if (side === 'original') drawOriginal();
  if (side !== 'both') return;
  const { x: width, y: height } = renderer.getSize(new Vector2());
  const line = Math.round(width * split);
  renderer.setScissorTest(true);
  renderer.setScissor(line, 0, width - line, height);
  drawDecoded();
  renderer.setScissor(0, 0, line, height);
  drawOriginal();
  renderer.setScissorTest(false);
}
