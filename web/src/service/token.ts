/** The access token of this page: in memory, or in session storage so that it outlives a reload. Never in an address. */

const KEY = 'cager-token';

/** Holds the token. Fires `change` when it changes, and `wanted` when the service refused the present one or asked for one. */
export class TokenStore extends EventTarget {
  private held: string | null;

  /** @param storage where the token outlives a reload; null where the browser has none for this page */
  constructor(private readonly storage: Storage | null) {
    super();
    this.held = guarded(() => storage?.getItem(KEY) ?? null);
  }

  get token(): string | null {
    return this.held;
  }

  /** Takes a token; `keep` keeps it until the tab is closed, otherwise until the page is. */
  set(token: string, keep: boolean) {
    this.held = token;
    guarded(() => (keep ? this.storage?.setItem(KEY, token) : this.storage?.removeItem(KEY)));
    this.dispatchEvent(new Event('change'));
  }

  clear() {
    this.held = null;
    guarded(() => this.storage?.removeItem(KEY));
    this.dispatchEvent(new Event('change'));
  }

  /** Says that the service refused the present token, or wants one. */
  refused() {
    this.dispatchEvent(new Event('wanted'));
  }
}

export const pageToken = new TokenStore(guarded(() => globalThis.sessionStorage));

/** What is read of storage, which throws where a browser's settings forbid it, or where it is full; null then. */
export function guarded<T>(use: () => T): T | null {
  try {
    return use();
  } catch {
    return null;
  }
}
