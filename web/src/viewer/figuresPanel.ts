import { html, nothing } from 'lit';
import { iconButton } from '../style/parts';
import type { Player } from './player';
import { bitrate, count, percent, SYSTEM_NAMES } from '../text';

export function figuresPanel(player: Player, close: () => void) {
  const { static: part, frames, frameBytes } = player.capture;
  const { decoder } = player.stage;
  const points = part.rest.length / 3;
  const isGreen = part.system === 'green-free';
  const cageRate = part.rowsPerFrame * 12 * player.transport.rate;
  const fileRate = frameBytes === undefined || frames === 0 ? null : (frameBytes / frames) * player.transport.rate;
  const rawRate = points * 12 * player.transport.rate;
  const row = (label: string, value: string) =>
    html`<dt>${label}</dt>
      <dd>${value}</dd>`;
  const { bits, error } = decoder.precision;
  const { live = null } = player.capture;
  return html`<aside class="panel glass" aria-label="Statistics">
    <header class="spread">
      <h2>Capture</h2>
      ${iconButton('close', 'Close', close)}
    </header>
    <dl class="pairs">
      ${row('Points', count(points))} ${row('Polygons', count(part.cornerCounts.length))}
      ${row('Frames', count(frames))}
      ${row('Frames per second', `${player.transport.rate}${part.frameRate === null ? ' (assumed)' : ''}`)}
    </dl>
    <h2>Cage</h2>
    <dl class="pairs">
      ${row('Vertices', count(part.cage.positions.length / 3))}
      ${row('Triangles', count(part.cage.triangles.length / 3))} ${row('Coordinates', SYSTEM_NAMES[part.system])}
      ${isGreen ? row('Vertices and normals', count(part.rowsPerFrame)) : nothing}
    </dl>
    <h2>Bandwidth</h2>
    <dl class="pairs">
      ${fileRate === null ? nothing : row('This file, frames alone', bitrate(fileRate))}
      ${row('Cages, uncompressed', bitrate(cageRate))} ${row('All points, uncompressed', bitrate(rawRate))}
    </dl>
    ${
      live
        ? html`<h2>Live</h2>
            <dl class="pairs">
              ${row('Latency', live.latencySeconds === null ? '–' : `${live.latencySeconds.toFixed(2)} s`)}
              ${row('Download rate', bitrate(live.bitsPerSecond / 8))}
              ${row('Frames received per second', live.framesPerSecond.toFixed(1))}
              ${live.codedFrames === null ? nothing : row('Frames compressed', count(live.codedFrames))}
              ${row('Frames pending', count(live.behindFrames))} ${row('Stalls', count(live.lateFrames))}
              ${row('Skipped frames', count(live.droppedFrames))}
            </dl>`
        : nothing
    }
    <h2>This browser</h2>
    <dl class="pairs">
      ${row('FPS', player.picturesPerSecond > 0 ? player.picturesPerSecond.toFixed(0) : '–')}
      ${row('Dropped frames', count(player.playback.dropped))}
      ${row('Weight precision', decoder.ready ? `${bits} bits` : '–')}
      ${error > 0 ? row('Rounding error', `< ${percent(error)}`) : nothing}
    </dl>
  </aside>`;
}
