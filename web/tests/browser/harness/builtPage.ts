/** The page as it is shipped, and a page of parts for tests, built once for all tests that need them. */

import { existsSync, mkdirSync, readdirSync, renameSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'vite';

const root = fileURLToPath(new URL('../../..', import.meta.url));
const folder = join(root, 'node_modules', '.cager-test-page');
const stamp = join(folder, 'built');
const lock = join(root, 'node_modules', '.cager-test-page.lock');
/** A build takes seconds; a lock that is older is that of tests that were killed. */
const STALE_MS = 120_000;

/** The folder with both pages: `index.html`, and `tests/browser/page/index.html`. Built anew where a source is newer. */
export async function builtPage(): Promise<string> {
  while (!isFresh()) {
    if (!takeLock()) {
      await new Promise((resolve) => setTimeout(resolve, 250));
      continue;
    }
    try {
      if (!isFresh()) await buildPage();
    } finally {
      rmSync(lock, { recursive: true, force: true });
    }
  }
  return folder;
}

async function buildPage(): Promise<void> {
  const began = new Date();
  const next = `${folder}.next`;
  const input = [join(root, 'index.html'), join(root, 'tests/browser/page/index.html')];
  // Vitest says that this is a test; the page is to be the one that is shipped.
  const environment = process.env.NODE_ENV ?? '';
  process.env.NODE_ENV = 'production';
  try {
    await build({
      root,
      mode: 'production',
      logLevel: 'error',
      build: { outDir: next, emptyOutDir: true, rolldownOptions: { input } },
    });
  } finally {
    process.env.NODE_ENV = environment;
  }
  writeFileSync(join(next, 'built'), began.toISOString());
  rmSync(folder, { recursive: true, force: true });
  renameSync(next, folder);
}

function isFresh(): boolean {
  if (!existsSync(stamp)) return false;
  const built = statSync(stamp).mtimeMs;
  return ['src', 'index.html', 'vite.config.ts', 'tests/browser/page'].every(
    (path) => newest(join(root, path)) < built,
  );
}

function newest(path: string): number {
  const found = statSync(path);
  if (!found.isDirectory()) return found.mtimeMs;
  return Math.max(found.mtimeMs, ...readdirSync(path).map((name) => newest(join(path, name))));
}

function takeLock(): boolean {
  try {
    mkdirSync(lock);
    return true;
  } catch {
    if (existsSync(lock) && Date.now() - statSync(lock).mtimeMs > STALE_MS)
      rmSync(lock, { recursive: true, force: true });
    return false;
  }
}
