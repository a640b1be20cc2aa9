/** Workers for a viewer that another page embeds. */

/** Addresses of scripts that import those of another origin, by these. */
const imports = new Map<string, string>();

/** What a worker posts first of all. */
export const STARTED = 'started';
/** How long a worker's script may take to come. */
const PATIENCE_MILLISECONDS = 30_000;

/**
 * Starts a module as a worker. Browsers start no script of another origin, as of an embedded viewer's service, but a script of the page's own may import it where
 * that service allows the page's origin.
 *
 * @param address of the module, which imports `workerStarted`, as `?worker&url` gives it
 * @param onFailure called with one sentence where the script does not come or ends by an error
 */
export function moduleWorker(address: string, onFailure: (error: Error) => void): Worker {
  const { href, origin } = new URL(address, document.baseURI);
  let script = origin === location.origin ? href : imports.get(href);
  if (script === undefined) {
    script = URL.createObjectURL(new Blob([`import ${JSON.stringify(href)};`], { type: 'text/javascript' }));
    imports.set(href, script);
  }
  const worker = new Worker(script, { type: 'module' });
  let hasStarted = false;
  const fail = () => {
    clearTimeout(timer);
    onFailure(new Error(`Part of the page ${hasStarted ? 'stopped' : 'could not be loaded'}. Reload the page.`));
  };
  const timer = setTimeout(fail, PATIENCE_MILLISECONDS);
  const start = (event: MessageEvent) => {
    if (event.data !== STARTED) return;
    hasStarted = true;
    clearTimeout(timer);
    // It is no answer to anything.
    event.stopImmediatePropagation();
    worker.removeEventListener('message', start);
  };
  worker.addEventListener('message', start);
  worker.addEventListener('error', fail);
  return worker;
}
