import { fragmentOf, parseFragment, type Route } from './routes';
import { page, tokens } from './style/tokens';

document.adoptedStyleSheets = [tokens.styleSheet!, page.styleSheet!];

/** The file that was dropped on the page last, for the route `#/file`. */
let dropped: File | null = null;
/** The route that is shown: a change of the view alone does not load it anew. */
let shown = '';

/** Loads what a route needs and makes its element. */
async function elementOf(route: Route, view: string): Promise<HTMLElement> {
  switch (route.page) {
    case 'session':
    case 'file': {
      const { ViewerPage } = await import('./viewer/viewerPage');
      const element = new ViewerPage();
      element.view = view;
      if (route.page === 'session') element.session = route.id;
      else element.file = dropped;
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
    message.textContent = 'A part of the page could not be loaded; reload it when the service answers again.';
    if (shown === wanted) document.body.replaceChildren(message);
  }
}

/** A capture that is dropped anywhere plays; other files are for the page that is shown. */
function dropCapture(event: DragEvent) {
  const file = event.dataTransfer?.files[0];
  if (event.defaultPrevented || !file) return;
  event.preventDefault();
  if (!/\.cager$/i.test(file.name)) return;
  openFile(file);
}

/** Goes to the page of files; what was shown is closed. */
function openFile(file: File) {
  dropped = file;
  history.pushState(null, '', fragmentOf({ page: 'file' }));
  void show(true);
}

/** A file that is opened from a session moves to its own route, so that its frame and camera are not written into the session's link. */
function chooseFile(event: CustomEvent<File>) {
  if (parseFragment(location.hash).route.page === 'file') {
    dropped = event.detail;
    return;
  }
  event.preventDefault();
  openFile(event.detail);
}

addEventListener('hashchange', () => void show());
addEventListener('dragover', (event) => event.preventDefault());
addEventListener('drop', dropCapture);
document.addEventListener('filechosen', (event) => chooseFile(event as CustomEvent<File>));
document.addEventListener('viewchange', (event) => {
  const { route } = parseFragment(location.hash);
  const view = new URLSearchParams((event as CustomEvent<string>).detail);
  if (route.page === 'session' || route.page === 'file') history.replaceState(null, '', fragmentOf(route, view));
});
void show();
