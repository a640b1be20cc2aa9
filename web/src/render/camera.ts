import type { OrthographicCamera, PerspectiveCamera } from 'three';
import { type boundsOf, middleOf } from '../coordinates/topology';

/** A camera that turns around a point. Lengths are in units of the rest pose's diagonal, angles in radians. */
export interface CameraState {
  readonly target: readonly [number, number, number];
  /** Angle around the vertical axis: 0 looks from +z, a quarter turn from +x. */
  readonly azimuth: number;
  /** Angle above the horizon. */
  readonly elevation: number;
  readonly distance: number;
  /** Whether it looks without perspective; what is at the target is as large as with it. */
  readonly isParallel?: boolean;
}

/** Vertical field of view in radians. */
export const FIELD_OF_VIEW = 0.56;
const STEEPEST = Math.PI / 2 - 0.01;
const [NEAREST, FARTHEST] = [0.02, 60];
/** How much larger than the box the picture is where it is framed. */
const ROOM = 1.16;

export const HOME: CameraState = { target: [0, 0, 0], azimuth: 0.5, elevation: 0.16, distance: 2.2 };

export function orbited(camera: CameraState, azimuth: number, elevation: number): CameraState {
  const steep = Math.min(STEEPEST, Math.max(-STEEPEST, camera.elevation + elevation));
  return { ...camera, azimuth: wrapped(camera.azimuth + azimuth), elevation: steep };
}

/** Comes nearer for factors below one. */
export function zoomed(camera: CameraState, factor: number): CameraState {
  return { ...camera, distance: Math.min(FARTHEST, Math.max(NEAREST, camera.distance * factor)) };
}

/** Moves target and camera in the plane of the picture, by fractions of the picture's height. */
export function panned(camera: CameraState, right: number, up: number): CameraState {
  const height = 2 * camera.distance * Math.tan(FIELD_OF_VIEW / 2);
  const axes = axesOf(camera);
  const move = (k: number) => camera.target[k] + height * (right * axes.right[k] + up * axes.up[k]);
  return { ...camera, target: [move(0), move(1), move(2)] };
}

/** Corners of a box, x y z each. */
export function cornersOf({ low, high }: ReturnType<typeof boundsOf>): Float64Array {
  return Float64Array.from({ length: 24 }, (_, at) => (Math.floor(at / 3) & (1 << (at % 3)) ? high : low)[at % 3]);
}

/** Points, x y z each, along the axes of a camera: to the right, upwards and towards it. */
export function seenFrom(camera: Pick<CameraState, 'azimuth' | 'elevation'>, points: ArrayLike<number>): Float64Array {
  const { right, up, back } = axesOf(camera);
  return Float64Array.from({ length: points.length }, (_, at) => {
    const [axis, first] = [[right, up, back][at % 3], at - (at % 3)];
    return points[first] * axis[0] + points[first + 1] * axis[1] + points[first + 2] * axis[2];
  });
}

/** Looks at points, x y z each, so that all of them fit into the picture, whose width is `aspect` times its height, with some room around them. */
export function framed(camera: CameraState, points: ArrayLike<number>, aspect: number): CameraState {
  if (points.length === 0) return camera;
  const seen = seenFrom(camera, points);
  const [x, y, z] = middleOf(seen);
  const slope = Math.tan(FIELD_OF_VIEW / 2) / ROOM;
  let distance = NEAREST;
  for (let at = 0; at < seen.length; at += 3) {
    const [across, high] = [Math.abs(seen[at] - x), Math.abs(seen[at + 1] - y)];
    const nearer = camera.isParallel ? 0 : seen[at + 2] - z;
    distance = Math.max(distance, Math.max(high, across / aspect) / slope + nearer);
  }
  const { right, up, back } = axesOf(camera);
  const along = (k: number) => x * right[k] + y * up[k] + z * back[k];
  return { ...camera, target: [along(0), along(1), along(2)], distance: Math.min(FARTHEST, distance) };
}

/** The same camera beside a model that has moved. */
export function shifted(camera: CameraState, by: readonly number[]): CameraState {
  const [x, y, z] = camera.target;
  return { ...camera, target: [x + by[0], y + by[1], z + by[2]] };
}

export function eyeOf(camera: CameraState): [number, number, number] {
  const { back } = axesOf(camera);
  const at = (k: number) => camera.target[k] + camera.distance * back[k];
  return [at(0), at(1), at(2)];
}

/** A camera between two others; goes the shorter way round. */
export function blended(from: CameraState, to: CameraState, share: number): CameraState {
  const mix = (a: number, b: number) => a + (b - a) * share;
  return {
    ...to,
    target: [0, 1, 2].map((k) => mix(from.target[k], to.target[k])) as [number, number, number],
    azimuth: wrapped(from.azimuth + wrapped(to.azimuth - from.azimuth) * share),
    elevation: mix(from.elevation, to.elevation),
    distance: Math.exp(mix(Math.log(from.distance), Math.log(to.distance))),
  };
}

/** Whether nobody sees the difference between two cameras. */
export function nearlySame(a: CameraState, b: CameraState): boolean {
  const far = Math.max(...a.target.map((value, k) => Math.abs(value - b.target[k]))) / b.distance;
  const turned = Math.max(Math.abs(wrapped(a.azimuth - b.azimuth)), Math.abs(a.elevation - b.elevation));
  return (
    Boolean(a.isParallel) === Boolean(b.isParallel) &&
    far < 2e-4 &&
    turned < 2e-4 &&
    Math.abs(Math.log(a.distance / b.distance)) < 2e-4
  );
}

/** The camera as text for links: angles in degrees, distance, target; without perspective the distance is negative. */
export function cameraText(camera: CameraState): string {
  const degrees = [camera.azimuth, camera.elevation].map((angle) => rounded((angle * 180) / Math.PI, 1));
  const distance = camera.isParallel ? -camera.distance : camera.distance;
  return [...degrees, ...[distance, ...camera.target].map((value) => rounded(value, 3))].join(',');
}

/** Reads {@link cameraText}; null where it is not one. */
export function cameraFromText(text: string | null): CameraState | null {
  if (text === null || text.length > 200) return null;
  const values = text.split(',').map((part) => (part.trim() === '' ? NaN : Number(part)));
  if (values.length !== 6 || !values.every((value) => Number.isFinite(value) && Math.abs(value) < 1e6)) return null;
  const [azimuth, elevation, distance, x, y, z] = values;
  const camera: CameraState = { target: [x, y, z], azimuth: 0, elevation: 0, distance: 1, isParallel: distance < 0 };
  return zoomed(orbited(camera, (azimuth * Math.PI) / 180, (elevation * Math.PI) / 180), Math.abs(distance));
}

/** Unit vectors to the right, upwards and towards the camera. */
export function axesOf({ azimuth, elevation }: Pick<CameraState, 'azimuth' | 'elevation'>) {
  const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
  return { right: [ca, 0, -sa], up: [-se * sa, ce, -se * ca], back: [ce * sa, se, ce * ca] };
}

function wrapped(angle: number): number {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

function rounded(value: number, digits: number): number {
  return Number(value.toFixed(digits));
}

export function aim(camera: PerspectiveCamera, state: CameraState) {
  camera.position.set(...eyeOf(state));
  camera.lookAt(...state.target);
  camera.near = state.distance * 0.02;
  camera.far = state.distance + 40;
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}

/** The same without perspective, for a picture of this aspect. */
export function aimParallel(camera: OrthographicCamera, state: CameraState, aspect: number) {
  camera.top = state.distance * Math.tan(FIELD_OF_VIEW / 2);
  camera.right = camera.top * aspect;
  [camera.left, camera.bottom] = [-camera.right, -camera.top];
  camera.position.set(...eyeOf(state));
  camera.lookAt(...state.target);
  [camera.near, camera.far] = [-40, state.distance + 40];
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}
