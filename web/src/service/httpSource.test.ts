import { createServer, type IncomingMessage, type Server, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { afterEach, expect, it } from 'vitest';
import { LocalCodec } from '../../tests/support/localCodec';
import { openContainer, type OpenOptions } from '../container/open';
import { blobSource, bytesSource, EndsCache, type Source } from '../container/source';
import { allBlocks, goldenBytes, openBytes } from '../../tests/support/containers';
import { httpSource } from './httpSource';

const options = (): OpenOptions => ({ codec: new LocalCodec() });
const bytes = goldenBytes('coded-green');
let server: Server | null = null;

afterEach(() => {
  server?.closeAllConnections();
  server?.close();
  server = null;
});

/** Serves on a free port; returns the address. */
async function serve(answer: (request: IncomingMessage, response: ServerResponse) => void): Promise<string> {
  server = createServer(answer);
  await new Promise<void>((resolve) => server?.listen(0, '127.0.0.1', resolve));
  return `http://127.0.0.1:${(server.address() as AddressInfo).port}/capture.cager`;
}

/** Answers as a server of files does. */
function answerRange(content: Uint8Array, etag: string, request: IncomingMessage, response: ServerResponse) {
  const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? '');
  const condition = request.headers['if-range'];
  if (range === null || (condition !== undefined && condition !== etag)) {
    response.writeHead(200, { ETag: etag }).end(content);
    return;
  }
  const [start, end] = [Number(range[1]), Math.min(Number(range[2]) + 1, content.length)];
  const sent = `bytes ${start}-${end - 1}/${content.length}`;
  response.writeHead(206, { ETag: etag, 'Content-Range': sent }).end(content.subarray(start, end));
}

/** A container of more than what is read at both ends. */
const padded = new Uint8Array(300_000).map((_, k) => k % 251);

it('a file gives what its bytes give', async () => {
  const blob = new Blob([bytes]);
  const capture = await openContainer(blobSource(blob), options());
  expect(await allBlocks(capture)).toEqual(await allBlocks(await openBytes(bytes)));
});

it('a server is asked for ranges of one version, with the headers of the caller', async () => {
  const seen: IncomingMessage['headers'][] = [];
  const url = await serve((request, response) => {
    seen.push(request.headers);
    answerRange(padded, '"a"', request, response);
  });
  const source = await httpSource(url, { headers: () => ({ Authorization: 'Bearer secret' }) });
  expect(source.size).toBe(padded.length);
  expect(await source.read(100, 50)).toEqual(padded.subarray(100, 150));
  expect(await source.read(200_000, 1000)).toEqual(padded.subarray(200_000, 201_000));
  expect(seen.map((headers) => headers.authorization)).toEqual(['Bearer secret', 'Bearer secret']);
  expect(seen[1]).toMatchObject({ range: 'bytes=200000-200999', 'if-range': '"a"' });
});

it('a resource that changes while it is read is noticed', async () => {
  let etag = '"a"';
  const url = await serve((request, response) => answerRange(padded, etag, request, response));
  const source = await httpSource(url);
  etag = '"b"';
  await expect(source.read(200_000, 10)).rejects.toThrow(/changed on the server.*Reload/);
});

it('a server without ranges is read whole', async () => {
  const url = await serve((_, response) => response.writeHead(200).end(bytes));
  const capture = await openContainer(await httpSource(url), options());
  expect(await allBlocks(capture)).toEqual(await allBlocks(await openBytes(bytes)));
});

it('an empty resource is no container', async () => {
  const url = await serve((_, response) => response.writeHead(416, { 'Content-Range': 'bytes */0' }).end());
  await expect(openContainer(await httpSource(url), options())).rejects.toThrow(/not a \.cager file/);
});

it('a refusal is said as the service says it', async () => {
  const url = await serve((_, response) => {
    const body = { type: 'urn:cager:problem:unauthorized', title: 'a token is needed', status: 401 };
    response.writeHead(401, { 'Content-Type': 'application/problem+json' }).end(JSON.stringify(body));
  });
  await expect(httpSource(url)).rejects.toThrow(/token is needed.*Sign in/);
});

it('a server that is gone is said to be', async () => {
  const url = await serve((request, response) => answerRange(padded, '"a"', request, response));
  const source = await httpSource(url);
  server?.closeAllConnections();
  server?.close();
  await expect(source.read(200_000, 10)).rejects.toThrow(/Cannot reach/);
});

it('a request can be given up', async () => {
  const url = await serve((request, response) => {
    if (request.headers.range === 'bytes=200000-200009') return;
    answerRange(padded, '"a"', request, response);
  });
  const source = await httpSource(url);
  const abort = new AbortController();
  const reading = source.read(200_000, 10, abort.signal);
  abort.abort();
  await expect(reading).rejects.toThrow(/abort/i);
});

it('what is at both ends is read once, and only the rest of what is longer', async () => {
  const seen: [number, number][] = [];
  const bytes = bytesSource(padded);
  const source: Source = {
    size: padded.length,
    read: (offset, length) => {
      seen.push([offset, length]);
      return bytes.read(offset, length);
    },
  };
  const ends = await EndsCache.of(source, 1000, 500);
  const check = async (start: number, end: number) =>
    expect(await ends.read(start, end - start)).toEqual(padded.subarray(start, end));
  await check(0, 1000);
  await check(200, 300);
  await check(299_500, 300_000);
  await check(299_600, 299_700);
  expect(seen.splice(0)).toEqual([
    [0, 1000],
    [299_500, 500],
  ]);
  await check(900, 2000);
  await check(5000, 6000);
  await check(299_000, 299_600);
  await check(500, 299_800);
  expect(seen).toEqual([
    [1000, 1000],
    [5000, 1000],
    [299_000, 500],
    [1000, 298_500],
  ]);
  const small = await EndsCache.of(bytesSource(padded.subarray(0, 1200)), 1000, 500);
  expect(await small.read(100, 1100)).toEqual(padded.subarray(100, 1200));
});

it('bytes in memory are read where they are', async () => {
  expect(await bytesSource(padded).read(5, 3)).toEqual(Uint8Array.of(5, 6, 7));
});
