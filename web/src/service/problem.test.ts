import { expect, test } from 'vitest';
import { ServiceProblem, isAbort, networkProblem, problemBehind, problemOf, sentenceOf } from './problem';
import { piecesOf } from './answers';

function answer(status: number, body: unknown, headers: Record<string, string> = {}): Response {
  return new Response(JSON.stringify(body), {
    status,
    headers: { 'Content-Type': 'application/problem+json', ...headers },
  });
}

test('a_problem_becomes_a_sentence_that_says_what_to_do', async () => {
  const quota = await problemOf(
    answer(507, { type: 'urn:cager:problem:quota-exceeded', detail: 'the tenant uses 3 of 3 bytes' }),
  );
  expect(quota.message).toBe(
    'The tenant uses 3 of 3 bytes. Delete sessions that are no longer needed, or ask for more space.',
  );
  expect(quota.passes).toBe(false);
  const file = await problemOf(
    answer(422, { type: 'urn:cager:problem:invalid-geometry', detail: 'cage.obj: it is open' }),
  );
  expect(file.message).toBe('cage.obj: it is open.');
});

test('what_passes_by_itself_is_told_from_what_does_not', async () => {
  const busy = await problemOf(
    answer(503, { type: 'urn:cager:problem:busy', detail: 'later' }, { 'Retry-After': '7' }),
  );
  expect([busy.passes, busy.retryAfter, busy.isGone]).toEqual([true, 7, false]);
  const gone = await problemOf(answer(404, { type: 'urn:cager:problem:not-found', detail: 'no' }));
  expect([gone.passes, gone.isGone]).toEqual([false, true]);
  expect(gone.message).not.toContain('/v1/');
  const unready = await problemOf(answer(409, { type: 'urn:cager:problem:not-ready', detail: 'wait' }));
  expect(unready.passes).toBe(true);
});

test('answers_of_proxies_and_broken_networks_are_sentences_too', async () => {
  const proxy = await problemOf(new Response('<html>502 Bad Gateway</html>', { status: 502 }));
  expect(proxy.message).toBe('The service is unreachable through its proxy (status 502). Try again later.');
  const lying = await problemOf(
    new Response('{', { status: 500, headers: { 'Content-Type': 'application/problem+json' } }),
  );
  expect(lying.message).toContain('status 500');
  expect(networkProblem(new TypeError('Failed to fetch'))).toMatchObject({ word: 'unreachable', passes: true });
  expect(sentenceOf(new Error('the file has no points'))).toBe('The file has no points.');
  expect(sentenceOf(new Error('walk.npy has 3 points'))).toBe('walk.npy has 3 points.');
  expect(sentenceOf(new ServiceProblem('unreachable', 0))).toContain('Cannot reach');
});

test('an_aborted_request_failed_for_the_reason_of_its_abort_whatever_the_browser_says', async () => {
  const said = new DOMException('BodyStreamBuffer was aborted', 'AbortError');
  const silent = new ServiceProblem('unreachable', 0);
  expect(networkProblem(said, AbortSignal.abort(silent))).toBe(silent);
  const late = AbortSignal.abort(new DOMException('signal timed out', 'TimeoutError'));
  expect(networkProblem(said, late)).toMatchObject({ word: 'unreachable', passes: true });
  expect(networkProblem(said, new AbortController().signal)).toBe(said);
  expect(isAbort(networkProblem(said, AbortSignal.abort()))).toBe(true);

  const left = new AbortController();
  const body = new ReadableStream({
    start: (stream) => left.signal.addEventListener('abort', () => stream.error(said)),
  });
  const read = piecesOf(new Response(body), left.signal).next();
  left.abort(silent);
  await expect(read).rejects.toBe(silent);
});

test('what_is_no_network_is_not_taken_for_one', () => {
  const mistake = new TypeError('x is undefined');
  expect(problemBehind(mistake)).toBe(mistake);
  const file = new DOMException('The requested file could not be read', 'NotReadableError');
  for (const problem of [problemBehind(file), networkProblem(file)]) {
    expect(problem).not.toBeInstanceOf(ServiceProblem);
    expect(problem.message).toBe('A file changed or was removed after it was added. Add it again.');
  }
});
