/** Names that one tab at a time holds (Web Locks), so that two of them do not work on the same thing. */

/**
 * Takes a name as soon as no other tab holds it, until `signal` ends that, or the waiting; browsers let go of it when the page is closed.
 *
 * @param onWait called when another tab holds it
 * @returns ends when the name is held; at once without a secure connection, where browsers have no locks
 */
export function holdName(name: string, signal: AbortSignal, onWait: () => void = () => undefined): Promise<void> {
  const locks = navigator.locks as LockManager | undefined;
  if (!locks) return Promise.resolve();
  return new Promise((resolve, reject) => {
    const hold = () => {
      resolve();
      return new Promise<void>((end) => {
        if (signal.aborted) end();
        signal.addEventListener('abort', () => end());
      });
    };
    const wait = () => {
      onWait();
      return locks.request(name, { signal }, hold);
    };
    locks.request(name, { ifAvailable: true }, (lock) => (lock ? hold() : wait())).catch(reject);
  });
}
