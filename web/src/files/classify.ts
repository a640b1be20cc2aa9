/** What dropped files are taken for: a rest pose, a cage, frames. People can say otherwise afterwards. */

import { serviceAddress } from '../text';
import { extensionOf } from './meshes';

/** A file and where it lay in what was dropped. */
export interface Dropped {
  readonly file: File;
  /** Path below the folder that was dropped, or the name. */
  readonly path: string;
}

export function isContainer({ path }: Dropped): boolean {
  return /\.cager$/i.test(path);
}

/** Whether there is something among files that an upload takes. */
export function isUploadable(files: readonly Dropped[]): boolean {
  return classify(files).some(({ role }) => role !== 'unused');
}

export type Role = 'rest' | 'cage' | 'frames' | 'unused';

/** A file, or a row of mesh files that are one frame each, and what it is taken for. */
export interface Item {
  readonly name: string;
  /** In the order of the numbers in their names. */
  readonly files: readonly File[];
  readonly role: Role;
  readonly choices: readonly Role[];
  /** Why it is not used, for kinds of files that cannot be. */
  readonly remark: string;
}

const ARRAYS = new Set(['npy', 'pc2', 'mdd']);
const MESHES = new Set(['obj', 'ply', 'off', 'stl', 'glb']);
const [REST, CAGE] = [/rest|bind|base|neutral/i, /cage|wrap/i];
const NATURAL = new Intl.Collator('en', { numeric: true });

/** Remarks on formats that this page does not take. */
const ELSEWHERE: Readonly<Record<string, string>> = {
  cager: 'Already encoded: open it with “Open file”.',
  npz: 'Save only the position array, as .npy.',
};
/** Animations that the command line takes and this page does not. */
const ANIMATIONS = new Set(['abc', 'usd', 'usda', 'usdc', 'usdz', 'gltf', 'fbx', 'mcx', 'mc']);

export function encodeElsewhere(): string {
  return `The page reads frames from .npy, .pc2, .mdd and .obj; encode this file with “cager encode --server ${serviceAddress()}”.`;
}

const LEFT = 'Another file is used for this. Upload one capture at a time.';

/** Sorts files into items and gives each a role; at most one is the rest pose, one the cage and one the frames. */
export function classify(dropped: readonly Dropped[]): Item[] {
  const rows = new Map<string, File[]>();
  const visible = dropped.filter(({ path }) => !path.split('/').some((part) => part.startsWith('.')));
  for (const { file, path } of [...visible].sort((a, b) => NATURAL.compare(a.path, b.path))) {
    // Files whose paths differ in their last number alone are frames, and share a row; rest poses or cages in several folders do not.
    const isNumbered = /\d/.test(REST.test(file.name) || CAGE.test(file.name) ? file.name : path);
    const key =
      isNumbered && extensionOf(file.name) === 'obj' ? path.replace(/\d+(\D*)$/, '#$1') : `${rows.size} ${path}`;
    const row = rows.get(key);
    if (row) row.push(file);
    else rows.set(key, [file]);
  }
  const items = [...rows.values()].map(itemOf);
  return withRoles(items);
}

/** The items with one given another role; whatever had it before is not used then. */
export function reassigned(items: readonly Item[], changed: Item, role: Role): Item[] {
  return items.map((item) => {
    if (item === changed) return { ...item, role, remark: '' };
    return role !== 'unused' && item.role === role ? { ...item, role: 'unused' } : item;
  });
}

function itemOf(files: File[]): Item {
  const [{ name }] = files;
  const extension = extensionOf(name);
  const base = { files, role: 'unused', remark: '' } as const;
  if (files.length > 1) return { ...base, name: `${name} and ${files.length - 1} more`, choices: ['frames', 'unused'] };
  if (ARRAYS.has(extension)) return { ...base, name, choices: ['frames', 'unused'] };
  if (MESHES.has(extension)) return { ...base, name, choices: ['rest', 'cage', 'unused'] };
  const remark = ANIMATIONS.has(extension) ? encodeElsewhere() : (ELSEWHERE[extension] ?? 'Unsupported file type.');
  return { ...base, name, choices: ['unused'], remark };
}

function withRoles(items: Item[]): Item[] {
  const meshes = items.filter((item) => item.choices.includes('rest'));
  const named = (word: RegExp) => meshes.find((item) => word.test(item.name));
  const others = meshes.filter((item) => !REST.test(item.name));
  const cage = named(CAGE) ?? bySize(others).at(meshes.length > 1 ? 0 : others.length);
  const rest = named(REST) ?? bySize(meshes.filter((item) => item !== cage)).at(-1);
  const frames = bySize(items.filter((item) => item.choices.includes('frames'))).at(-1);
  const order: readonly Role[] = ['rest', 'frames', 'cage', 'unused'];
  const withRole = items.map((item): Item => {
    const role = item === frames ? 'frames' : item === rest ? 'rest' : item === cage ? 'cage' : 'unused';
    const isLeft = role === 'unused' && item.choices.length > 1;
    return { ...item, role, remark: isLeft ? LEFT : item.remark };
  });
  return withRole.sort((a, b) => order.indexOf(a.role) - order.indexOf(b.role));
}

/** Smallest first: cages are smaller than models, and captures larger than anything beside them. */
function bySize(items: readonly Item[]): Item[] {
  const size = (item: Item): number => item.files.reduce((sum, file) => sum + file.size, 0);
  return [...items].sort((a, b) => size(a) - size(b));
}
