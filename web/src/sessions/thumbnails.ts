/** Small pictures of sessions that this browser has shown, for the list. */

import { guarded } from '../service/token';

const PREFIX = 'cager-thumbnail ';
const MAX_PICTURES = 200;

/** The address of a session's picture; null where it was not shown here. */
export function thumbnailOf(session: string): string | null {
  return guarded(() => localStorage.getItem(PREFIX + session)?.replace(/^\d+ /, '') ?? null);
}

/** Keeps the picture of a session in place of the oldest one. */
export function keepThumbnail(session: string, address: string) {
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
