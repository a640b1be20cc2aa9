/** What the browser tests need beside Node: a browser, and the program under test. */

import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { findChromium } from './chromium';

const here = (path: string): string => fileURLToPath(new URL(`../../../${path}`, import.meta.url));

/** Chromium or a relative of it; `CHROMIUM` names another one. */
export const chromium = findChromium();

/** The program `cager`; `CAGER_BINARY` names another one than what the build leaves. */
export const cager = firstOf([
  process.env.CAGER_BINARY,
  here('../target/release/cager'),
  here('../target/debug/cager'),
]);

/** Why browser tests cannot run; null where they can. It is printed, so that nobody takes them for passed. */
export const missing: string | null = chromium
  ? cager
    ? null
    : 'the program cager was not found; build it, or set CAGER_BINARY'
  : 'no Chromium was found; install it, set CHROMIUM, or let `make page-test` fetch one';

if (missing) process.stderr.write(`Browser tests are skipped: ${missing}.\n`);

function firstOf(paths: (string | undefined)[]): string | undefined {
  return paths.find((path) => path !== undefined && path !== '' && existsSync(path));
}
