/** How methods look in charts: one colour for each pair of points read and treatment of the spectrum, whatever the threshold. */

import type { Method } from './data';

const COLORS: Readonly<Record<string, string>> = {
  'all none': 'light-dark(#0072b2, #4aa8e8)',
  'all laplacian': 'light-dark(#2b3fae, #8f9cf5)',
  'all global': 'light-dark(#4fa6d8, #8fd0f5)',
  'maxvol none': 'light-dark(#e08b00, #f5b042)',
  'maxvol laplacian': 'light-dark(#d1460f, #ff7a45)',
  'maxvol global': 'light-dark(#b55f95, #e08fc0)',
  'maxvol truncated-svd': 'light-dark(#6b7280, #a5adb8)',
  'maxvol tikhonov': 'light-dark(#8d95a1, #848c98)',
  'maxvol differential': 'light-dark(#6a4fb3, #b39ddb)',
  'maxvol temporal': 'light-dark(#3d8f8f, #7fcaca)',
  'spread none': 'light-dark(#4cb391, #8fe0c0)',
  'spread laplacian': 'light-dark(#00825f, #35c796)',
  'spread differential': 'light-dark(#4b7f00, #a9d95b)',
  'rectangular none': 'light-dark(#c2ae2b, #efe28a)',
  'rectangular laplacian': 'light-dark(#8f7d00, #d6c244)',
};

/** Colours of series that are no methods. */
export const OTHER_COLORS = {
  plain: 'light-dark(#78808d, #8b93a0)',
  normal: 'light-dark(#b55f95, #e08fc0)',
} as const;

type Look = Pick<Method, 'handles' | 'regularizer'>;

export function methodColor({ handles, regularizer }: Look): string {
  return COLORS[`${handles} ${regularizer}`] ?? 'light-dark(#7a5230, #cfa27a)';
}

/** Methods that treat the whole spectrum have dashed lines, as a second mark beside the colour. */
export function isDashed({ regularizer }: Look): boolean {
  return ['global', 'truncated-svd', 'tikhonov'].includes(regularizer);
}

export function isPaperMethod({ handles, regularizer }: Look): boolean {
  return handles === 'maxvol' && regularizer === 'laplacian';
}

/** Its name without the threshold. */
export function familyName({ name }: Method): string {
  return name.split(' s = ')[0];
}
