/** Routes of the page, all in the fragment: `#/`, `#/session/ID`, `#/recovery/ID`, `#/transfer/ID`, `#/file`, `#/upload`. What follows `?` is the state of the view, for links; of the list, what is searched and the page. */

import type { JobKind } from './viewer/serviceCapture';

export type Route =
  { page: 'sessions' } | { page: 'session' | JobKind; id: string } | { page: 'file' } | { page: 'upload' };

/** A route and the parameters of its view, such as the frame and the camera. */
export interface Location {
  readonly route: Route;
  readonly view: URLSearchParams;
}

/** Reads a fragment, with or without its `#`; anything unknown is the list of sessions. */
export function parseFragment(fragment: string): Location {
  const [path, query] = splitOnce(fragment.replace(/^#/, ''), '?');
  const view = new URLSearchParams(query);
  const [page, id, ...more] = path.split('/').filter((part) => part !== '');
  if ((page === 'session' || page === 'recovery' || page === 'transfer') && id && more.length === 0)
    return { route: { page, id: decoded(id) }, view };
  if (page === 'file') return { route: { page: 'file' }, view };
  if (page === 'upload') return { route: { page: 'upload' }, view };
  return { route: { page: 'sessions' }, view };
}

export function fragmentOf(route: Route, view = new URLSearchParams()): string {
  const path =
    route.page === 'sessions'
      ? '#/'
      : 'id' in route
        ? `#/${route.page}/${encodeURIComponent(route.id)}`
        : `#/${route.page}`;
  const query = view.toString();
  return query === '' ? path : `${path}?${query}`;
}

/** The list as it was shown last, for ways back to it. */
let list = '#/';

export function listAddress(): string {
  return list;
}

/** Keeps a view in the address of its route, without a step of the history. */
export function keepView(view: URLSearchParams) {
  const { route } = parseFragment(location.hash);
  const address = fragmentOf(route, view);
  if (route.page === 'sessions') list = address;
  history.replaceState(null, '', address);
}

function splitOnce(text: string, separator: string): [string, string] {
  const at = text.indexOf(separator);
  return at < 0 ? [text, ''] : [text.slice(0, at), text.slice(at + separator.length)];
}

/** Links are typed by people: a broken escape is taken as it stands. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
