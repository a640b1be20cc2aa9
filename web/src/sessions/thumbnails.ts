/** Small pictures of sessions that this browser has shown, for the list. */

import { guarded } from '../service/token';

const PREFIX = 'cager-thumbnail ';
const MAX_PICTURES = 200;
const [WIDTH, HEIGHT] = [112, 84];

/** The address of a session's picture; null where it was not shown here. */
export function thumbnailOf(session: string): string | null {
  return guarded(() => localStorage.getItem(PREFIX + session)?.replace(/^\d+ /, '') ?? null);
}

export function keepThumbnail(session: string, picture: HTMLCanvasElement) {
  const address = shrunk(picture);
  if (address === null) return;
  guarded(() => {
    const names = Object.keys(localStorage).filter((name) => name.startsWith(PREFIX));
    if (names.length >= MAX_PICTURES) {
      const age = (name: string) => parseInt(localStorage.getItem(name) ?? '0');
      localStorage.removeItem(names.reduce((a, b) => (age(a) <= age(b) ? a : b)));
    }
    localStorage.setItem(PREFIX + session, `${Date.now()} ${address}`);
  });
}

/** Pictures are for those who may see the sessions. */
export function forgetThumbnails() {
  guarded(() => {
    for (const name of Object.keys(localStorage)) if (name.startsWith(PREFIX)) localStorage.removeItem(name);
  });
}

/** The middle of a picture, as the address of a small one; null where the browser cannot draw it. */
function shrunk(picture: HTMLCanvasElement): string | null {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [WIDTH, HEIGHT];
  const context = canvas.getContext('2d');
  const height = Math.min(picture.height, (picture.width * HEIGHT) / WIDTH);
  const width = (height * WIDTH) / HEIGHT;
  if (!context || height === 0) return null;
  const [left, top] = [(picture.width - width) / 2, (picture.height - height) / 2];
  context.drawImage(picture, left, top, width, height, 0, 0, WIDTH, HEIGHT);
  return canvas.toDataURL('image/webp', 0.75);
}
