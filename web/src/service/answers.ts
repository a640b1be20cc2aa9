/** Answers of the service and their bodies: what breaks off is a `ServiceProblem`. */

import { networkProblem } from './problem';

/** The answer to a request, whatever its status. */
export async function fetched(url: string, init: RequestInit): Promise<Response> {
  try {
    return await fetch(url, init);
  } catch (error) {
    throw networkProblem(error, init.signal);
  }
}

export async function bodyOf(response: Response, signal: AbortSignal | undefined): Promise<ArrayBuffer> {
  try {
    return await response.arrayBuffer();
  } catch (error) {
    throw networkProblem(error, signal);
  }
}

export async function textOf(response: Response, signal: AbortSignal | undefined): Promise<string> {
  return new TextDecoder().decode(await bodyOf(response, signal));
}

/** The pieces of an answer's body as they arrive; what breaks off is a problem like any other, and an abort of the request's signal has its reason. */
export async function* piecesOf(
  response: Response,
  signal: AbortSignal | undefined,
): AsyncGenerator<Uint8Array, void, undefined> {
  const reader = response.body?.getReader();
  if (!reader) return;
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      yield value;
    }
  } catch (error) {
    throw networkProblem(error, signal);
  } finally {
    // Whoever stops reading ends the request; of a body that ended this does nothing.
    await reader.cancel().catch(() => undefined);
  }
}
