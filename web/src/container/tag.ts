export const KNOWN_TAGS: ReadonlySet<string> = new Set(
  'HEAD ORIG RPTS RFAC rcol CVTX CTRI ELEM FRAM resi ERRS fnum summ TOC_'.split(' '),
);

/** Whether a reader that does not know the section must refuse the file. */
export function isRequired(tag: string): boolean {
  return !/^[a-z]/.test(tag);
}
