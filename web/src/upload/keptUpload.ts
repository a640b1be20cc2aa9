/** What is kept of an upload until it is over, so that it can go on after the page was closed. Never the token. */

import { holdName } from '../heldName';
import { guarded } from '../service/token';
import type { FileMarks } from './fileMarks';
import type { Choices } from './optionsForm';

const PREFIX = 'cager-upload ';
/** Uploads that nobody took up again are forgotten. */
const DAYS = 14;

export interface UploadRecord {
  /** Makes its requests known to the service when they are repeated. */
  readonly key: string;
  /** The service, by its address. */
  readonly service: string;
  /** Milliseconds since 1970. */
  readonly begun: number;
  readonly choices: Choices;
  readonly marks: FileMarks;
  readonly frames: number;
  /** Known once the service has made them. */
  readonly session: string | null;
  readonly design: string | null;
}

/** The record of one upload, in the storage of the page; in memory alone where the browser keeps nothing. */
export class KeptUpload {
  private sending = new AbortController();

  constructor(private record: UploadRecord) {}

  get present(): UploadRecord {
    return this.record;
  }

  set(part: Partial<Pick<UploadRecord, 'session' | 'design' | 'key'>>) {
    const isOther = part.key !== undefined && part.key !== this.record.key;
    if (isOther) this.forget();
    this.record = { ...this.record, ...part };
    guarded(() => localStorage.setItem(PREFIX + this.record.key, JSON.stringify(this.record)));
  }

  forget() {
    guarded(() => localStorage.removeItem(PREFIX + this.record.key));
  }

  /** Says to the other tabs that this one sends it, until {@link release}. */
  hold() {
    this.sending = new AbortController();
    // Where browsers have no locks, or give none, every tab offers to go on.
    holdName(PREFIX + this.record.key, this.sending.signal).catch(() => undefined);
  }

  release() {
    this.sending.abort();
  }
}

/** Names of records that {@link unfinishedUploads} waits for. */
const awaited = new Set<string>();

/**
 * Uploads to a service that were not finished and that no open tab is sending, newest first.
 *
 * @param onFreed called when a tab has ended, or stopped sending one that is left out for that; a page that is loaded anew overlaps with itself
 */
export async function unfinishedUploads(service: string, onFreed: () => void): Promise<KeptUpload[]> {
  const locks = navigator.locks as LockManager | undefined;
  const held = new Set((await locks?.query())?.held?.map(({ name }) => name));
  for (const name of held) {
    if (!name?.startsWith(PREFIX) || awaited.has(name)) continue;
    awaited.add(name);
    void locks?.request(name, { mode: 'shared' }, () => {
      awaited.delete(name);
      onFreed();
    });
  }
  const records = guarded(() =>
    Object.keys(localStorage)
      .filter((name) => name.startsWith(PREFIX) && !held.has(name))
      .map((name) => recordOf(name)),
  );
  return (records ?? [])
    .filter((record) => record?.service === service)
    .sort((a, b) => b!.begun - a!.begun)
    .map((record) => new KeptUpload(record!));
}

/** The record of a name; null, and forgotten, where it is too old or was written by another version of the page. */
function recordOf(name: string): UploadRecord | null {
  try {
    const record = JSON.parse(localStorage.getItem(name) ?? '') as UploadRecord;
    const isWhole = PREFIX + record.key === name && record.frames > 0 && typeof record.choices.name === 'string';
    if (isWhole && 'frames' in record.marks && Date.now() - record.begun < 86_400_000 * DAYS) return record;
  } catch {
    // What cannot be read is forgotten.
  }
  localStorage.removeItem(name);
  return null;
}

/** A number that nobody else draws; pages without a secure connection have no `randomUUID`. */
export function newKey(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
}
