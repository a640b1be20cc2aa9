/** Views of a capture that somebody saved, in the storage of the browser. */

import type { Capture } from '../capture';
import { guarded } from '../service/token';

const PREFIX = 'cager-views ';
const MAX_VIEWS = 20;

/** Views as text, as links have them. */
export function savedViews(capture: Capture): readonly string[] {
  const found = guarded(() => JSON.parse(localStorage.getItem(nameOf(capture)) ?? '[]') as unknown);
  return Array.isArray(found) ? found.filter((view) => typeof view === 'string').slice(0, MAX_VIEWS) : [];
}

/** Returns whether the browser keeps them. */
export function saveViews(capture: Capture, views: readonly string[]): boolean {
  const name = nameOf(capture);
  const isKept = guarded(() => {
    if (views.length === 0) localStorage.removeItem(name);
    else localStorage.setItem(name, JSON.stringify(views.slice(-MAX_VIEWS)));
    return true;
  });
  return isKept ?? false;
}

function nameOf({ identity, name }: Capture): string {
  return `${PREFIX}${identity ?? `file ${name}`}`;
}
