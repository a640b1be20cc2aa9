/** Passes requests on to a service and counts the bytes of its answers, as they travel. */

import { type Server, createServer, request } from 'node:http';
import type { AddressInfo } from 'node:net';

export class Meter {
  /** Bytes of bodies so far, by path. */
  readonly bytes = new Map<string, number>();

  private constructor(private readonly server: Server) {}

  static async start(origin: string): Promise<Meter> {
    const server = createServer((asked, answer) => {
      const path = (asked.url ?? '/').replace(/\?.*/, '');
      // Browsers ask for less over addresses without TLS than they would in use.
      const headers = { ...asked.headers, 'accept-encoding': 'gzip' };
      const passed = request(`${origin}${asked.url ?? '/'}`, { method: asked.method, headers }, (response) => {
        answer.writeHead(response.statusCode ?? 502, response.headers);
        response.on('data', (piece: Buffer) => meter.add(path, piece.length));
        response.pipe(answer);
      });
      passed.once('error', () => answer.destroy());
      answer.once('close', () => passed.destroy());
      asked.pipe(passed);
    });
    const meter = new Meter(server);
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    return meter;
  }

  get base(): string {
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}/`;
  }

  /** Bytes of the answers whose paths match. */
  total(paths: RegExp): number {
    return [...this.bytes].reduce((sum, [path, bytes]) => sum + (paths.test(path) ? bytes : 0), 0);
  }

  reset(): void {
    this.bytes.clear();
  }

  close(): void {
    this.server.closeAllConnections();
    this.server.close();
  }

  private add(path: string, bytes: number): void {
    this.bytes.set(path, (this.bytes.get(path) ?? 0) + bytes);
  }
}
