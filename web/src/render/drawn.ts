import { Vector2, type WebGLRenderer } from 'three';

export interface Layers {
  readonly model: boolean;
  readonly wireframe: boolean;
  readonly points: boolean;
  readonly cage: boolean;
  readonly handles: boolean;
  readonly ground: boolean;
  /** Colours of the model's points, where it has any. */
  readonly colors: boolean;
  /** Materials of the model's faces, where it has any. */
  readonly materials: boolean;
}

/** Colours of the picture, as CSS colours in sRGB. */
export interface StageColors {
  readonly top: string;
  readonly bottom: string;
  readonly model: string;
  readonly wire: string;
  readonly cage: string;
  readonly handle: string;
  readonly grid: string;
  readonly shadow: number;
}

/** What of a capture whose original is there is drawn: what is decoded, the original, the original to the left of a line, or the original translucent over what is decoded. */
export type Side = 'decoded' | 'original' | 'both' | 'ghost';

/** CSS pixels of the canvas that something lies above. */
export interface Covered {
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
  readonly left: number;
}

/** @param line where the original ends and what is decoded begins, in CSS pixels from the left */
export function drawSide(
  renderer: WebGLRenderer,
  side: Side,
  line: number,
  drawDecoded: () => void,
  drawOriginal: () => void,
  drawGhost: () => void,
) {
  if (side === 'decoded' || side === 'ghost') drawDecoded();
  if (side === 'ghost') drawGhost();
  if (side === 'original') drawOriginal();
  if (side !== 'both') return;
  const { x: width, y: height } = renderer.getSize(new Vector2());
  renderer.setScissorTest(true);
  const begin = Math.round(line);
  renderer.setScissor(begin, 0, width - begin, height);
  drawDecoded();
  renderer.setScissor(0, 0, begin, height);
  drawOriginal();
  renderer.setScissorTest(false);
}
