/** Workers for a viewer that another page embeds. */

/** Addresses of scripts that import those of another origin, by these. */
const imports = new Map<string, string>();

/**
 * Starts a module as a worker. Browsers start no script of another origin, as of an embedded viewer's service, but a script of the page's own may import it where
 * that service allows the page's origin.
 *
 * @param address of the module, as `?worker&url` gives it
 */
export function moduleWorker(address: string): Worker {
  const { href, origin } = new URL(address, document.baseURI);
  if (origin === location.origin) return new Worker(href, { type: 'module' });
  let script = imports.get(href);
  if (script === undefined) {
    script = URL.createObjectURL(new Blob([`import ${JSON.stringify(href)};`], { type: 'text/javascript' }));
    imports.set(href, script);
  }
  return new Worker(script, { type: 'module' });
}
