/** What a service refused, or that it could not be reached, as one sentence for people and a word for programs. */

import { CHANGED_FILE } from '../files/frameSource';

/** Problem details as the service sends them (RFC 9457); docs/OPERATIONS.md lists the types. */
export interface ProblemDetails {
  readonly type?: string;
  readonly title?: string;
  readonly status?: number;
  readonly detail?: string;
}

const TYPE_PREFIX = 'urn:cager:problem:';

/** Statuses of proxies and of a busy service that pass by themselves. */
const PASSING = new Set([0, 408, 425, 429, 502, 503, 504]);

/** Conflicts that end when the service has done what it is doing. */
const PASSING_WORDS = new Set(['not-ready', 'idempotency-key-in-use']);

/** How reading files fails that somebody chose and that are not what they were. */
const FILE_ERRORS = new Set(['NotReadableError', 'NotFoundError']);

/** What to say instead of the service's detail, which is written for those who write programs. */
const INSTEAD: Readonly<Record<string, string>> = {
  unreachable: 'Cannot reach the service. Check that it is running and that you are online.',
  'not-found': 'Not found: it was deleted, has expired, or belongs to someone else. Choose another one from the list.',
  'session-deleted': 'This session was deleted. Choose another one from the list.',
  stopping: 'The service is restarting. This page reconnects automatically.',
};

/** What to add to the service's detail. */
const ADVICE: Readonly<Record<string, string>> = {
  unauthorized: 'Sign in with an access token; ask your administrator for one.',
  'quota-exceeded': 'Delete sessions that are no longer needed, or ask for more space.',
  'too-many-sessions': 'Delete sessions that are no longer needed.',
  'storage-full': 'Ask your administrator to free disk space.',
  'storage-failed': 'Ask your administrator to check the disk.',
  'frame-conflict': 'Upload to a new session.',
};

/** A request that failed. `message` is a sentence to show. */
export class ServiceProblem extends Error {
  override readonly name = 'ServiceProblem';

  /**
   * @param word last word of the problem's type, such as `not-found`; `unreachable` where there was no answer, `unknown` where the answer
   *   was not the service's own
   * @param status HTTP status; 0 without an answer
   * @param details what the service said
   * @param retryAfter seconds that it asked to wait
   */
  constructor(
    readonly word: string,
    readonly status: number,
    details: ProblemDetails = {},
    readonly retryAfter: number | null = null,
  ) {
    super(sentence(word, status, details));
  }

  /** Whether the same request may succeed later. */
  get passes(): boolean {
    return PASSING.has(this.status) || PASSING_WORDS.has(this.word);
  }

  /** Whether the session that was asked for is gone for good. */
  get isGone(): boolean {
    return this.word === 'not-found' || this.word === 'session-deleted';
  }
}

/** What an answer with an error status says; its body is read. */
export async function problemOf(response: Response): Promise<ServiceProblem> {
  const wait = Number(response.headers.get('retry-after') ?? Number.NaN);
  const retryAfter = Number.isFinite(wait) && wait >= 0 ? wait : null;
  const type = response.headers.get('content-type') ?? '';
  let details: ProblemDetails = {};
  if (type.startsWith('application/problem+json'))
    details = await (response.json() as Promise<ProblemDetails>).catch(() => ({}));
  return problemFrom(details, response.status, retryAfter);
}

/** A problem from its details, as they stand in a session's `problem` or at the end of a stream of results. */
export function problemFrom(details: ProblemDetails, status = details.status ?? 0, retryAfter: number | null = null) {
  const word = details.type?.startsWith(TYPE_PREFIX) ? details.type.slice(TYPE_PREFIX.length) : 'unknown';
  return new ServiceProblem(word, status, details, retryAfter);
}

/**
 * What a failed `fetch` or a broken stream means; errors that are problems already, and aborts, stay what they are.
 *
 * @param signal of the request. Where it was aborted its reason counts: browsers differ in the error that reading a body ends with then.
 */
export function networkProblem(failure: unknown, signal?: AbortSignal | null): Error {
  const behind = problemBehind(signal?.aborted ? signal.reason : failure);
  // Browsers report every failure of the network as a TypeError without a stable text.
  const isNetwork = behind instanceof TypeError || (behind instanceof DOMException && !isAbort(behind));
  return isNetwork ? new ServiceProblem('unreachable', 0) : behind;
}

/** The same of anything else that failed, which says nothing about the network. */
export function problemBehind(error: unknown): Error {
  if (error instanceof DOMException && error.name === 'TimeoutError') return new ServiceProblem('unreachable', 0);
  if (error instanceof DOMException && FILE_ERRORS.has(error.name))
    return new Error(`A file ${CHANGED_FILE}`, { cause: error });
  return error instanceof Error ? error : new Error(String(error));
}

export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === 'AbortError';
}

/** The sentence of any error, for `problem` fields and messages. */
export function sentenceOf(error: unknown): string {
  const behind = problemBehind(error);
  return behind instanceof ServiceProblem ? behind.message : finished(behind.message || 'Something went wrong');
}

function sentence(word: string, status: number, details: ProblemDetails): string {
  if (INSTEAD[word]) return INSTEAD[word];
  const detail = details.detail ?? details.title;
  if (!detail) {
    const what = PASSING.has(status) ? 'is unreachable through its proxy' : 'sent an unexpected answer';
    return `The service ${what} (status ${status}). Try again later.`;
  }
  return [finished(detail), ADVICE[word]].filter(Boolean).join(' ');
}

function finished(text: string): string {
  // The name of a file stays as it is.
  const begun = /^\S+\.\w+[: ]/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?…]$/.test(begun) ? begun : `${begun}.`;
}
