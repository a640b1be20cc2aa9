import { orbited } from '../render/camera';
import type { Player } from './player';

const TURN_SECONDS = 8;
const PICTURES_PER_SECOND = 30;
const TYPES = ['video/mp4;codecs=avc1.640028', 'video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm'];

export function canRecord(): boolean {
  return typeof MediaRecorder !== 'undefined' && 'captureStream' in HTMLCanvasElement.prototype;
}

/**
 * Records one turn of the camera around the model while the capture plays. Rejects with the signal's reason when aborted.
 *
 * @returns the video, and the ending that its format has in file names
 */
export async function recordTurntable(
  player: Player,
  signal: AbortSignal,
  onProgress: (fraction: number) => void,
): Promise<{ video: Blob; ending: 'mp4' | 'webm' }> {
  const type = TYPES.find((name) => MediaRecorder.isTypeSupported(name));
  if (type === undefined) throw new Error('This browser cannot record videos; use another one.');
  const stream = player.stage.canvas.captureStream(PICTURES_PER_SECOND);
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: 12_000_000 });
  const pieces: Blob[] = [];
  recorder.addEventListener('dataavailable', ({ data }) => pieces.push(data));
  const stopped = new Promise<void>((resolve) => recorder.addEventListener('stop', () => resolve()));
  const start = player.controls.destination;
  player.resolution.isForFile = true;
  player.drawn();
  recorder.start();
  try {
    await turn(signal, (fraction) => {
      player.controls.go(orbited(start, fraction * 2 * Math.PI, 0), true);
      onProgress(fraction);
    });
  } finally {
    recorder.stop();
    for (const track of stream.getTracks()) track.stop();
    player.resolution.isForFile = false;
    player.controls.go(start, true);
  }
  await stopped;
  return { video: new Blob(pieces, { type }), ending: type.startsWith('video/mp4') ? 'mp4' : 'webm' };
}

/** Calls with the fraction of the turn before every picture. */
async function turn(signal: AbortSignal, onFraction: (fraction: number) => void) {
  const begin = performance.now();
  for (;;) {
    const now = await new Promise<number>(requestAnimationFrame);
    signal.throwIfAborted();
    const fraction = Math.min(1, Math.max(0, (now - begin) / 1000 / TURN_SECONDS));
    onFraction(fraction);
    if (fraction === 1) return;
  }
}
