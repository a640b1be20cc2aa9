import {
  BufferTarget,
  CanvasSource,
  getFirstEncodableVideoCodec,
  Mp4OutputFormat,
  Output,
  Quality,
  WebMOutputFormat,
} from 'mediabunny';
import { orbited } from '../render/camera';
import type { Player } from './player';
import { advanced } from './transport';

const SECONDS = 8;
const PICTURES_PER_SECOND = 30;
const QUALITY = new Quality({ bitrate: 12_000_000 });

/**
 * Records one turn of the camera around the model, which plays meanwhile if it did before: picture by picture, each of its own place, however long that takes. Rejects
 * with the signal's reason when aborted, and with one sentence for a person where the browser encodes no videos.
 *
 * @returns the video, and the ending that its format has in file names
 */
export async function recordTurntable(
  player: Player,
  signal: AbortSignal,
  onProgress: (fraction: number) => void,
): Promise<{ video: Blob; ending: 'mp4' | 'webm' }> {
  if (typeof VideoEncoder === 'undefined')
    throw new Error(
      'This browser cannot record videos here. Use a current one, and an address that begins with https.',
    );
  const { transport, controls, resolution, stage } = player;
  const start = controls.destination;
  resolution.isForFile = true;
  // Encoders take pictures of even sizes alone.
  const [width, height] = [stage.canvas.width, stage.canvas.height].map((size) => size & ~1);
  const picture = new OffscreenCanvas(width, height);
  const context = picture.getContext('2d', { alpha: false })!;
  const target = new BufferTarget();
  let output: Output | null = null;
  try {
    const encoding = { width, height, quality: QUALITY };
    const codec = await getFirstEncodableVideoCodec(['avc', 'vp9', 'av1', 'vp8'], encoding);
    if (codec === null)
      throw new Error('This browser has no encoder for videos of this size. Make the window smaller.');
    const isMp4 = codec === 'avc';
    output = new Output({ format: isMp4 ? new Mp4OutputFormat() : new WebMOutputFormat(), target });
    const source = new CanvasSource(picture, { codec, quality: QUALITY });
    output.addVideoTrack(source, { frameRate: PICTURES_PER_SECOND });
    await output.start();
    const pictures = SECONDS * PICTURES_PER_SECOND;
    let place = transport;
    for (let k = 0; k < pictures; k++) {
      signal.throwIfAborted();
      controls.go(orbited(start, (k / pictures) * 2 * Math.PI, 0), true);
      await player.stand(place, signal);
      context.drawImage(player.drawn(), 0, 0, width, height);
      await source.add(k / PICTURES_PER_SECOND, 1 / PICTURES_PER_SECOND);
      place = advanced(place, 1 / PICTURES_PER_SECOND);
      onProgress((k + 1) / pictures);
    }
    await output.finalize();
    const type = isMp4 ? 'video/mp4' : 'video/webm';
    return { video: new Blob([target.buffer!], { type }), ending: isMp4 ? 'mp4' : 'webm' };
  } catch (error) {
    await output?.cancel();
    throw error;
  } finally {
    resolution.isForFile = false;
    controls.go(start, true);
    player.transport = transport;
  }
}
