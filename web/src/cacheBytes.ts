/** Bytes of captures that the page keeps in memory. Phones end pages that take much, and browsers that do not say how much memory there is are often those of phones. */
const { deviceMemory = 0 } = (globalThis.navigator as { deviceMemory?: number } | undefined) ?? {};
const CACHE_BYTES = 2 ** 20 * (deviceMemory >= 8 ? 288 : 96);

/** What each cache may take of it: decoded blocks, offsets of the frames around the one that is shown, and coded groups of a session that runs. */
export const BLOCK_BYTES = CACHE_BYTES / 2;
export const OFFSET_BYTES = CACHE_BYTES / 4;
export const GROUP_BYTES = CACHE_BYTES / 4;
