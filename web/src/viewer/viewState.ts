import type { UpAxis } from '../capture';
import { cameraFromText, cameraText, type CameraState } from '../render/camera';
import type { Layers } from '../render/drawn';
import type { Heat } from './heatMap';

/** What a link says about the view: everything in it is optional. */
export interface ViewState {
  readonly frame: number | null;
  readonly camera: CameraState | null;
  /** Null for the capture's own. */
  readonly up: UpAxis | null;
  /** The same of the capture beside it. */
  readonly besideUp: UpAxis | null;
  /** Null where the motion decides. */
  readonly follow: boolean | null;
  readonly layers: Layers;
  readonly heat: Heat;
}

export const USUAL_LAYERS: Layers = {
  model: true,
  wireframe: false,
  points: false,
  cage: false,
  handles: false,
  ground: true,
  colors: true,
  materials: true,
};

const LETTERS: Readonly<Record<keyof Layers, string>> = {
  model: 'm',
  wireframe: 'w',
  points: 'p',
  cage: 'c',
  handles: 'h',
  ground: 'g',
  colors: 'k',
  // Links of captures without materials do not name them, so that theirs says that they are off.
  materials: 'x',
};
const NAMES = Object.keys(LETTERS) as (keyof Layers)[];

function isToldWhenOn(name: keyof Layers): boolean {
  return name !== 'materials';
}

/** Reads `frame=12&camera=…&up=z&besideUp=z&follow=1&show=mcg&heat=motion`; what is missing or wrong is as usual. */
export function viewFromText(text: string): ViewState {
  const parameters = new URLSearchParams(text);
  const frame = Number(parameters.get('frame') ?? NaN);
  const show = parameters.get('show');
  const heat = parameters.get('heat');
  const follow = parameters.get('follow');
  return {
    frame: Number.isSafeInteger(frame) && frame >= 0 ? frame : null,
    camera: cameraFromText(parameters.get('camera')),
    up: axisFrom(parameters.get('up')),
    besideUp: axisFrom(parameters.get('besideUp')),
    follow: follow === '1' ? true : follow === '0' ? false : null,
    layers: show === null ? USUAL_LAYERS : layersOf((name) => show.includes(LETTERS[name]) === isToldWhenOn(name)),
    heat: heat === 'motion' || heat === 'error' ? heat : 'none',
  };
}

/** Writes what {@link viewFromText} reads; what is as usual is left out. */
export function viewText({ frame, camera, up, besideUp, follow, layers, heat }: ViewState): string {
  const parameters = new URLSearchParams();
  if (frame !== null) parameters.set('frame', String(frame));
  if (camera) parameters.set('camera', cameraText(camera));
  if (up) parameters.set('up', up);
  if (besideUp) parameters.set('besideUp', besideUp);
  if (follow !== null) parameters.set('follow', follow ? '1' : '0');
  if (NAMES.some((name) => layers[name] !== USUAL_LAYERS[name])) {
    const shown = NAMES.filter((name) => layers[name] === isToldWhenOn(name)).map((name) => LETTERS[name]);
    parameters.set('show', shown.join(''));
  }
  if (heat !== 'none') parameters.set('heat', heat);
  return parameters.toString().replaceAll('%2C', ',');
}

function axisFrom(text: string | null): UpAxis | null {
  return text === 'y' || text === 'z' ? text : null;
}

function layersOf(shown: (name: keyof Layers) => boolean): Layers {
  return Object.fromEntries(NAMES.map((name) => [name, shown(name)])) as unknown as Layers;
}
