/** A client of the service for tests: what other programs do while somebody looks at the page. */

import type { Session, SessionOptions } from '../../../src/service/messages';
import type { SphereCapture } from './sphere';

export class TestClient {
  /**
   * @param origin address of the service without a path
   * @param token where the service wants one
   */
  constructor(
    private readonly origin: string,
    private readonly token = '',
  ) {}

  async create(
    capture: Pick<SphereCapture, 'rest' | 'cage'>,
    options: SessionOptions & { handles?: string },
  ): Promise<Session> {
    const body = new FormData();
    body.append('options', JSON.stringify(options));
    body.append('rest', new Blob([capture.rest]), 'rest.obj');
    body.append('cage', new Blob([capture.cage]), 'cage.obj');
    return (await this.call('', { method: 'POST', body })).json() as Promise<Session>;
  }

  async session(id: string): Promise<Session> {
    return (await this.call(`/${id}`)).json() as Promise<Session>;
  }

  async whenReady(id: string): Promise<Session> {
    for (;;) {
      const session = await this.session(id);
      if (session.state !== 'preparing') return session;
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  /** Posts frames and waits until they are solved. */
  async post(id: string, capture: SphereCapture, first: number, count: number): Promise<void> {
    const headers = { 'Content-Type': 'application/octet-stream' };
    const init = { method: 'POST', headers, body: capture.frames(first, count) };
    await (await this.call(`/${id}/frames?first=${first}`, init)).text();
  }

  async complete(id: string, frames: number): Promise<void> {
    const headers = { 'Content-Type': 'application/json' };
    await (await this.call(`/${id}/complete`, { method: 'POST', headers, body: JSON.stringify({ frames }) })).text();
  }

  /** A completed session of these frames. */
  async encode(capture: SphereCapture, options: SessionOptions, frames: number): Promise<string> {
    const { id } = await this.create(capture, options);
    await this.whenReady(id);
    await this.post(id, capture, 0, frames);
    await this.complete(id, frames);
    return id;
  }

  async call(path: string, init: RequestInit = {}): Promise<Response> {
    const headers = new Headers(init.headers);
    if (this.token !== '') headers.set('Authorization', `Bearer ${this.token}`);
    const response = await fetch(`${this.origin}/v1/sessions${path}`, { ...init, headers });
    if (!response.ok) throw new Error(`${response.status} ${await response.text()}`);
    return response;
  }
}
