/** Files and folders that somebody drops or picks. */

import type { Dropped } from './classify';

/** Most files that are taken from folders: a capture of a frame per file has some thousand. */
const MAX_FILES = 100_000;

/** All files of a drop, those in folders included. The transfer is read before the first wait, as browsers demand. */
export async function droppedFiles(transfer: DataTransfer): Promise<Dropped[]> {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  if (entries.length === 0) return pickedFiles(transfer.files);
  const found: Dropped[] = [];
  for (const entry of entries) await collect(entry, found);
  return found;
}

/** Has the browser ask for files with these endings, all where there are none, or for a folder of them. */
export function pickFiles(
  take: (files: Dropped[]) => void,
  { accept = '', isFolder = false }: { readonly accept?: string; readonly isFolder?: boolean } = {},
): void {
  const input = Object.assign(document.createElement('input'), { type: 'file', multiple: true, accept });
  input.webkitdirectory = isFolder;
  input.addEventListener('change', () => input.files?.length && take(pickedFiles(input.files)));
  input.click();
}

/** Files of an `<input type="file">`, or of a drop without those in folders. */
export function pickedFiles(files: Iterable<File>): Dropped[] {
  return [...files].map((file) => ({ file, path: file.webkitRelativePath || file.name }));
}

async function collect(entry: FileSystemEntry, found: Dropped[]): Promise<void> {
  if (found.length >= MAX_FILES)
    throw new Error(`There are more than ${MAX_FILES} files; drop only the folder of the capture.`);
  if (entry instanceof FileSystemDirectoryEntry) {
    const reader = entry.createReader();
    for (;;) {
      // A folder is read in batches of a hundred or so; an empty one is the end.
      const batch = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
      if (batch.length === 0) return;
      for (const inside of batch) await collect(inside, found);
    }
  }
  if (entry instanceof FileSystemFileEntry) {
    const file = await new Promise<File>((resolve, reject) => entry.file(resolve, reject));
    found.push({ file, path: entry.fullPath.replace(/^\//, '') });
  }
}
