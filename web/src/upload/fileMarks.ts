/** What tells the files of one upload from those of another, by their names and sizes. */

import { counted, size } from '../text';
import type { Item, Role } from '../files/classify';

/** Files with one role. */
export interface FileMark {
  readonly name: string;
  readonly files: number;
  /** Of all of them. */
  readonly bytes: number;
}

/** The files of an upload; what was not there is null. */
export type FileMarks = Readonly<Record<Exclude<Role, 'unused'>, FileMark | null>>;

const NAMES = { rest: 'rest pose', cage: 'cage', frames: 'frames' } as const;

export function marksOf(items: readonly Item[]): FileMarks {
  const mark = (role: Role): FileMark | null => {
    const item = items.find((one) => one.role === role);
    if (!item) return null;
    const { name, files } = item;
    return { name, files: files.length, bytes: files.reduce((sum, file) => sum + file.size, 0) };
  };
  return { rest: mark('rest'), cage: mark('cage'), frames: mark('frames') };
}

/** Why files are not those of an earlier upload, in a sentence; null where they are. */
export function difference(marks: FileMarks, earlier: FileMarks): string | null {
  for (const role of ['frames', 'rest', 'cage'] as const) {
    const [now, then] = [marks[role], earlier[role]];
    if (!now && !then) continue;
    if (!then) return `The interrupted upload had no ${NAMES[role]}: remove ${now!.name}.`;
    if (!now) return `The ${NAMES[role]} ${described(then)} of the interrupted upload: file missing.`;
    const isSame = now.files === then.files && now.bytes === then.bytes;
    if (!isSame) return `The ${NAMES[role]} of the interrupted upload: ${described(then)}, not ${described(now)}.`;
  }
  return null;
}

/** Whether frames or rest poses have the same name. */
export function shareNames(a: FileMarks, b: FileMarks): boolean {
  return (['frames', 'rest'] as const).some((role) => a[role] !== null && a[role].name === b[role]?.name);
}

/** The items with the roles that files of these names had. */
export function withEarlierRoles(items: readonly Item[], earlier: FileMarks): Item[] {
  const roles = ['rest', 'cage', 'frames'] as const;
  const roleOf = (item: Item): Role => roles.find((role) => earlier[role]?.name === item.name) ?? 'unused';
  const isWhole = roles.every((role) => !earlier[role] || items.some((item) => roleOf(item) === role));
  return isWhole ? items.map((item) => ({ ...item, role: roleOf(item) })) : [...items];
}

function described({ name, bytes }: FileMark): string {
  const length = bytes < 1e6 ? counted(bytes, 'byte') : size(bytes);
  return `${name} (${length})`;
}
