import { fragmentOf, keepView, parseFragment, type Route } from './routes';
import { page, tokens } from './style/tokens';
import { isContainer, type Dropped } from './files/classify';
import { pickedFiles } from './files/drop';

document.adoptedStyleSheets = [tokens.styleSheet!, page.styleSheet!];

/** What was dropped on the page last, for the route `#/file`. */
let dropped: readonly Dropped[] = [];
/** The route that is shown: a change of the view alone does not load it anew. */
let shown = '';

async function elementOf(route: Route, view: string): Promise<HTMLElement> {
  switch (route.page) {
    case 'session':
    case 'recovery':
    case 'transfer':
    case 'file': {
      const { ViewerPage } = await import('./viewer/viewerPage');
      const element = new ViewerPage();
      element.view = view;
      if (route.page === 'file') element.files = dropped;
      else [element.kind, element.job] = [route.page, route.id];
      return element;
    }
    case 'upload':
      await import('./upload/cagerUpload');
      return document.createElement('cager-upload');
    case 'sessions':
      await import('./sessions/cagerSessions');
      return document.createElement('cager-sessions');
  }
}

async function show(anew = false) {
  const { route, view } = parseFragment(location.hash);
  const wanted = fragmentOf(route);
  if (wanted === shown && !anew) {
    document.querySelector('cager-viewer-page')?.goTo(view.toString());
    document.querySelector('cager-sessions')?.goTo(view);
    return;
  }
  shown = wanted;
  try {
    const element = await elementOf(route, view.toString());
    if (shown === wanted) document.body.replaceChildren(element);
  } catch {
    const message = document.createElement('p');
    message.className = 'failure';
    message.setAttribute('role', 'alert');
    const reload = document.createElement('button');
    reload.textContent = 'Reload';
    reload.addEventListener('click', () => location.reload());
    message.append('Part of the page could not be loaded. Check your connection and reload. ', reload);
    if (shown === wanted) document.body.replaceChildren(message);
  }
}

/** A capture that is dropped anywhere plays; other files are for the page that is shown. */
function dropCapture(event: DragEvent) {
  const files = pickedFiles(event.dataTransfer?.files ?? []);
  if (event.defaultPrevented || files.length === 0) return;
  event.preventDefault();
  if (files.some(isContainer)) openFiles(files);
}

/** Goes to the page of files; what was shown is closed. */
function openFiles(files: readonly Dropped[]) {
  dropped = files;
  history.pushState(null, '', fragmentOf({ page: 'file' }));
  void show(true);
}

/** Files that are opened from a session move to their own route, so that frame and camera are not written into the session's link. */
function chooseFiles(event: CustomEvent<readonly Dropped[]>) {
  if (parseFragment(location.hash).route.page === 'file') {
    dropped = event.detail;
    return;
  }
  event.preventDefault();
  openFiles(event.detail);
}

addEventListener('hashchange', () => void show());
addEventListener('dragover', (event) => event.preventDefault());
addEventListener('drop', dropCapture);
document.addEventListener('filechosen', (event) => chooseFiles(event as CustomEvent<readonly Dropped[]>));
document.addEventListener('viewchange', (event) => {
  const { page } = parseFragment(location.hash).route;
  if (page !== 'sessions' && page !== 'upload') keepView(new URLSearchParams((event as CustomEvent<string>).detail));
});
void show();
