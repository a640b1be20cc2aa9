import { describe, expect, it } from 'vitest';
import { nextEvent } from './backoff';

describe('the next event', () => {
  it('is the first one of any target', async () => {
    const [one, other] = [new EventTarget(), new EventTarget()];
    const next = nextEvent(undefined, [one, 'change'], [other, 'end']);
    other.dispatchEvent(new Event('end'));
    await expect(next).resolves.toBeUndefined();
  });

  it('is not waited for after an abort, whose reason is thrown', async () => {
    const stop = new AbortController();
    const next = nextEvent(stop.signal, [new EventTarget(), 'change']);
    stop.abort(new Error('enough'));
    await expect(next).rejects.toThrow('enough');
    await expect(nextEvent(stop.signal, [new EventTarget(), 'change'])).rejects.toThrow('enough');
  });
});
