/** Views of a capture that somebody saved, in the storage of the browser. */

import type { Capture } from '../capture';
import { guarded } from '../service/token';

const PREFIX = 'cager-views ';
const MAX_VIEWS = 20;

/** Views as text, as links have them. */
export function savedViews(capture: Capture): readonly string[] {
  const found: unknown = guarded(() => JSON.parse(localStorage.getItem(nameOf(capture)) ?? '[]'));
  return Array.isArray(found) ? found.filter((view) => typeof view === 'string').slice(0, MAX_VIEWS) : [];
}

/** Returns whether the browser keeps them. */
export function saveViews(capture: Capture, views: readonly string[]): boolean {
  const name = nameOf(capture);
  const keep = () => localStorage.setItem(name, JSON.stringify(views.slice(-MAX_VIEWS)));
  return guarded(() => (views.length === 0 ? localStorage.removeItem(name) : keep()) ?? true) ?? false;
}

function nameOf({ identity, name }: Capture): string {
  return `${PREFIX}${identity ?? `file ${name}`}`;
}
