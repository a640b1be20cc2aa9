/** Edits that outlive the page: in the browser's database (IndexedDB), by capture. */

import type { Capture } from '../capture';
import { crc32c } from '../container/crc32c';
import type { CageEdit, FrameRange } from './cageEdit';
import type { Grip } from './grip';
import type { Motion } from './motion';

const DATABASE = 'cager-edits';
const STORE = 'captures';
/** Captures whose edits are kept; those that were changed the longest ago go first. */
const MAX_CAPTURES = 40;
/** Most bytes of one capture's edits. */
const MAX_BYTES = 32 << 20;
/** Bytes at the beginning and at the end of a container that tell it from others. */
const [HEAD_BYTES, TAIL_BYTES] = [1 << 16, 1 << 13];

export interface KeptEdits {
  /** The capture: see {@link identityOf}. */
  readonly key: string;
  /** Milliseconds since 1970. */
  readonly changed: number;
  readonly edits: readonly CageEdit[];
}

/**
 * `kept`: they are there after a reload. `large`: they take more room than one capture is given. `elsewhere`: another tab keeps its edits of the
 * capture, and these would take their place. `refused`: the browser keeps nothing here.
 */
export type Keeping = 'kept' | 'large' | 'elsewhere' | 'refused';

/** What a capture is known by when the page is loaded anew: the session, or the name, the length and the ends of its container. */
export async function identityOf(capture: Capture): Promise<string | null> {
  if (capture.identity !== undefined) return capture.identity;
  if (!capture.container) return null;
  const source = await capture.container();
  const { size } = source;
  const head = await source.read(0, Math.min(HEAD_BYTES, size));
  const tail = await source.read(Math.max(0, size - TAIL_BYTES), Math.min(TAIL_BYTES, size));
  return ['file', capture.name, size, crc32c(tail, crc32c(head)).toString(16)].join(' ');
}

export async function hasKeptEdits(): Promise<boolean> {
  try {
    return (await inStore('readonly', (store) => store.count())) > 0;
  } catch {
    return false;
  }
}

/** The kept edits of a capture whose cage has so many vertices; null if nothing was kept, or for another cage. */
export async function keptEdits(key: string, vertices: number): Promise<KeptEdits | null> {
  try {
    const found = await inStore('readonly', (store) => store.get(key) as IDBRequest<KeptEdits | undefined>);
    const edits = found?.edits.filter((edit) => isUsable(edit, vertices)) ?? [];
    return found && edits.length > 0 ? { ...found, edits } : null;
  } catch {
    return null;
  }
}

/** Keeps the edits of a capture in place of those that were kept; none are forgotten. Whether they are there after a reload. */
export async function keepEdits(key: string, edits: readonly CageEdit[]): Promise<Keeping> {
  try {
    if (edits.length === 0) {
      await inStore('readwrite', (store) => store.delete(key));
      return 'kept';
    }
    if (edits.reduce((sum, { grip }) => sum + bytesOf(grip), 0) > MAX_BYTES) return 'large';
    await inStore('readwrite', (store) => store.put({ key, changed: Date.now(), edits } satisfies KeptEdits));
    await forgetOldest();
    return 'kept';
  } catch {
    return 'refused';
  }
}

async function forgetOldest(): Promise<void> {
  const count = await inStore('readonly', (store) => store.count());
  if (count <= MAX_CAPTURES) return;
  const keys = await inStore('readonly', (store) => store.index('changed').getAllKeys(null, count - MAX_CAPTURES));
  for (const key of keys) await inStore('readwrite', (store) => store.delete(key));
}

function bytesOf({ own, mirror }: Grip): number {
  return own.byteLength + (mirror?.own.byteLength ?? 0);
}

/** Does one thing to the store; resolves when it is on disk. */
async function inStore<T>(mode: IDBTransactionMode, act: (store: IDBObjectStore) => IDBRequest<T>): Promise<T> {
  const database = await opened();
  try {
    return await new Promise<T>((resolve, reject) => {
      const transaction = database.transaction(STORE, mode);
      const request = act(transaction.objectStore(STORE));
      const failed = () => reject(transaction.error ?? new Error('The browser refused to keep the edits.'));
      transaction.addEventListener('complete', () => resolve(request.result));
      transaction.addEventListener('abort', failed);
      transaction.addEventListener('error', failed);
    });
  } finally {
    database.close();
  }
}

function opened(): Promise<IDBDatabase> {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(DATABASE, 1);
    request.addEventListener('upgradeneeded', () => {
      request.result.createObjectStore(STORE, { keyPath: 'key' }).createIndex('changed', 'changed');
    });
    request.addEventListener('success', () => resolve(request.result));
    const failed = () => reject(request.error ?? new Error('The browser has no database for this page.'));
    request.addEventListener('error', failed);
    request.addEventListener('blocked', failed);
  });
}

/** Whether something that was kept, perhaps by another version of the page, is an edit of a cage with so many vertices. */
export function isUsable(edit: CageEdit, vertices: number): boolean {
  const isVertex = (v: unknown) => Number.isInteger(v) && (v as number) >= 0 && (v as number) < vertices;
  const isList = (list: unknown) => Array.isArray(list) && list.length > 0 && list.every(isVertex);
  const areWeights = (own: unknown) =>
    own instanceof Float64Array && own.length === vertices && own.every((weight) => weight >= 0 && weight <= 1);
  const { grip, motion, range } = (edit as CageEdit | null) ?? ({} as Partial<CageEdit>);
  if (!grip || !motion || !range) return false;
  const { mirror } = grip;
  return (
    isList(grip.chosen) &&
    areWeights(grip.own) &&
    (mirror === null || ([0, 1, 2].includes(mirror.axis) && isList(mirror.chosen) && areWeights(mirror.own))) &&
    isMotion(motion) &&
    isRange(range)
  );
}

function isMotion(motion: Motion): boolean {
  const areNumbers = (list: unknown, length: number) =>
    Array.isArray(list) && list.length === length && list.every(Number.isFinite);
  if (motion.kind === 'move') return areNumbers(motion.by, 3);
  if (motion.kind === 'rotate') return areNumbers(motion.rotation, 4);
  return areNumbers(motion.factors, 3) && motion.factors.every((factor) => factor > 0);
}

function isRange({ first, last, easeIn, easeOut }: FrameRange): boolean {
  return [first, last, easeIn, easeOut].every((n) => Number.isInteger(n) && n >= 0) && first <= last;
}
