/** Serves the built page under a path prefix, and passes everything below `v1/` on to the service, as a proxy of a studio does. */

import { createReadStream, existsSync, statSync } from 'node:fs';
import { type IncomingMessage, type Server, type ServerResponse, createServer, request } from 'node:http';
import type { AddressInfo } from 'node:net';
import { extname, join, normalize } from 'node:path';
import { builtPage } from './builtPage';

const PREFIX = '/captures/';
const POLICY =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; worker-src 'self'; font-src 'self'; media-src blob:";
const TYPES: Readonly<Record<string, string>> = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript',
  '.css': 'text/css',
  '.svg': 'image/svg+xml',
};

export class PageServer {
  /** The next answer to an address that ends so stops after this many bytes; {@link breakOff} then closes its connection. */
  stopNext: { readonly path: string; readonly bytes: number } | null = null;

  readonly #passing = new Set<IncomingMessage>();
  readonly #stopped = new Set<ServerResponse>();
  #isStalled = false;
  /** How many requests with frames are passed on before others wait. */
  #frameRequests = Infinity;
  readonly #waiting: (() => void)[] = [];

  private constructor(
    private readonly server: Server,
    /** Address of the page. */
    readonly base: string,
    /** Address of the page of parts. */
    readonly parts: string,
  ) {}

  /** @param origin of the service at the time of each request */
  static async start(origin: () => string): Promise<PageServer> {
    const folder = await builtPage();
    const server = createServer((asked, answer) => {
      const path = new URL(asked.url ?? '/', 'http://localhost').pathname;
      // The page of parts lies deeper; both find the service beside themselves.
      const isPassed = ['v1/', 'tests/browser/page/v1/'].some((below) => path.startsWith(PREFIX + below));
      if (isPassed && found.#isStalled) return;
      const passOn = (begun: readonly Buffer[] = []) =>
        pass(origin(), asked, answer, found.#lengthOf(path, answer), found.#passing, begun);
      if (isPassed && asked.method === 'POST' && path.endsWith('/frames') && found.#frameRequests-- <= 0)
        found.#hold(asked, answer, passOn);
      else if (isPassed) passOn();
      else send(folder, path, answer);
    });
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    const base = `http://127.0.0.1:${(server.address() as AddressInfo).port}${PREFIX}`;
    const found = new PageServer(server, base, `${base}tests/browser/page/`);
    return found;
  }

  /** Passes nothing on any more, and ends nothing, as a network that is lost. */
  stall(): void {
    this.#isStalled = true;
    this.#passing.forEach((response) => response.unpipe());
  }

  /** Passes so many requests with frames on and holds the others back until {@link release}: an upload lasts as long as a test needs. */
  holdFrames(passed = 0): void {
    this.#frameRequests = passed;
  }

  release(): void {
    this.#frameRequests = Infinity;
    for (const passOn of this.#waiting.splice(0)) passOn();
  }

  /** Keeps a request until {@link release}. Its body is read meanwhile, as else nothing would tell that the page has given it up. */
  #hold(asked: IncomingMessage, answer: ServerResponse, passOn: (begun: readonly Buffer[]) => void): void {
    const begun: Buffer[] = [];
    const take = (piece: Buffer) => begun.push(piece);
    asked.on('data', take);
    this.#waiting.push(() => {
      asked.off('data', take);
      if (!answer.destroyed) passOn(begun);
    });
  }

  /** Passes new requests on again. */
  recover(): void {
    this.#isStalled = false;
  }

  /** Closes the connections of answers that were stopped. */
  breakOff(): void {
    this.#stopped.forEach((answer) => answer.destroy());
    this.#stopped.clear();
  }

  /** After how many bytes the answer to `path` stops. */
  #lengthOf(path: string, answer: ServerResponse): number {
    if (!this.stopNext || !path.endsWith(this.stopNext.path)) return Infinity;
    const { bytes } = this.stopNext;
    this.stopNext = null;
    this.#stopped.add(answer);
    return bytes;
  }

  close(): void {
    this.server.closeAllConnections();
    this.server.close();
  }
}

function pass(
  origin: string,
  asked: IncomingMessage,
  answer: ServerResponse,
  length: number,
  passing: Set<IncomingMessage>,
  begun: readonly Buffer[],
): void {
  const url = (asked.url ?? '').replace(/^.*?\/v1\//, '/v1/');
  const passed = request(`${origin}${url}`, { method: asked.method, headers: asked.headers }, (response) => {
    answer.writeHead(response.statusCode ?? 502, response.headers);
    // Answers that are followed have to show at once.
    answer.flushHeaders();
    passing.add(response);
    response.once('close', () => passing.delete(response));
    let left = length;
    if (length < Infinity) {
      response.on('data', (piece: Buffer) => {
        if (left > 0) answer.write(piece.subarray(0, left));
        left -= piece.length;
      });
    } else response.pipe(answer);
    response.once('error', () => answer.destroy());
    response.once('aborted', () => answer.destroy());
  });
  passed.once('error', () => {
    if (answer.headersSent) answer.destroy();
    else answer.writeHead(502).end();
  });
  answer.once('close', () => passed.destroy());
  for (const piece of begun) passed.write(piece);
  if (asked.readableEnded) passed.end();
  else asked.pipe(passed);
}

function send(folder: string, path: string, answer: ServerResponse): void {
  const below = path.startsWith(PREFIX) ? normalize(path.slice(PREFIX.length)) : '..';
  const file = join(folder, below.endsWith('/') || below === '.' ? `${below}/index.html` : below);
  if (below.startsWith('..') || !existsSync(file) || !statSync(file).isFile()) {
    answer.writeHead(404).end();
    return;
  }
  answer.writeHead(200, {
    'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream',
    'Content-Security-Policy': POLICY,
    'X-Content-Type-Options': 'nosniff',
    // As the service does for its allowed origins.
    'Access-Control-Allow-Origin': '*',
  });
  createReadStream(file).pipe(answer);
}
