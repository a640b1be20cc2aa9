import { fragmentOf, keepView, parseFragment, type Route } from './routes';
import { page, tokens } from './style/tokens';
import { isContainer, type Dropped } from './files/classify';
import { droppedFiles, pickedFiles } from './files/drop';

document.adoptedStyleSheets = [tokens.styleSheet!, page.styleSheet!];

/** What was dropped on the page last, for the route `#/file`. */
let dropped: readonly Dropped[] = [];
/** What is to be uploaded, for the route `#/upload`. */
let added: readonly Dropped[] = [];
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
    case 'upload': {
      const { Upload } = await import('./upload/cagerUpload');
      const element = new Upload();
      if (added.length > 0) void element.take(added);
      added = [];
      return element;
    }
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
  document.title = route.page === 'upload' ? 'Upload – CageR' : 'CageR';
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

/** A capture that is dropped anywhere plays; other files are for the page that is shown, those on the list to be uploaded. */
function dropCapture(event: DragEvent) {
  const { dataTransfer } = event;
  const files = pickedFiles(dataTransfer?.files ?? []);
  if (event.defaultPrevented || !dataTransfer || files.length === 0) return;
  event.preventDefault();
  if (files.some(isContainer)) openFiles(files);
  else if (parseFragment(location.hash).route.page === 'sessions') void droppedFiles(dataTransfer).then(upload);
}

/** Goes to the page of uploads with files. */
function upload(files: readonly Dropped[]) {
  added = files;
  history.pushState(null, '', fragmentOf({ page: 'upload' }));
  void show(true);
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
document.addEventListener('uploadwanted', (event) => upload((event as CustomEvent<readonly Dropped[]>).detail));
document.addEventListener('viewchange', (event) => {
  const { page } = parseFragment(location.hash).route;
  if (page !== 'sessions' && page !== 'upload') keepView(new URLSearchParams((event as CustomEvent<string>).detail));
});
void show();
