/** Where Chromium is, or a relative of it. */

import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

/** The package that `tools/chromium.ts` takes a browser from where there is none, and the checksum of its archive. */
export const PACKAGE = {
  name: '@sparticuz/chromium',
  version: '153.0.0',
  integrity: 'sha512-jiGWqSvPMdu4+P9TilYqAR7yEGPEHINx+lCvE/NqNO/EHYzF/x1hUiI5T6ioVIt7dEy7n88byyT0vk+dnsgQwA==',
};

/** Where that browser is put. */
export const packagedFolder = fileURLToPath(new URL(`../../../../target/chromium/${PACKAGE.version}`, import.meta.url));

const usual = [
  '/usr/bin/chromium',
  '/usr/bin/chromium-browser',
  '/usr/bin/google-chrome',
  '/Applications/Google Chrome.app/Contents/MacOS/Google Chrome',
  '/Applications/Chromium.app/Contents/MacOS/Chromium',
];

/** Looks for the browser: `CHROMIUM` names one, and `CHROMIUM=package` stands for that of the package, whatever else is installed. */
export function findChromium(): string | undefined {
  const named = process.env.CHROMIUM ?? '';
  const packaged = `${packagedFolder}/run`;
  const places = named === 'package' ? [packaged] : [named, ...usual, packaged];
  return places.find((path) => path !== '' && existsSync(path));
}
