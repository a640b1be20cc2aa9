/** A service, the page beside it and a browser: what most browser tests begin with. */

import type { Browser } from 'playwright-core';
import { leave, sharedBrowser } from './browser';
import { builtPage } from './builtPage';
import { TestClient } from './client';
import { PageServer } from './pageServer';
import { TestService } from './service';

export class Site {
  private constructor(
    readonly service: TestService,
    readonly server: PageServer,
    readonly browser: Browser,
  ) {}

  /** Parameters as of {@link TestService.start}. */
  static async start(...options: Parameters<typeof TestService.start>): Promise<Site> {
    // Before the service is started, so that a page that cannot be built leaves none behind.
    await builtPage();
    const service = await TestService.start(...options);
    const server = await PageServer.start(() => service.origin);
    return new Site(service, server, await sharedBrowser());
  }

  /** Address of the page: that which the service itself serves where `CAGER_WEB_BASE` is `service`, else the one that was just built. */
  get page(): string {
    return process.env.CAGER_WEB_BASE === 'service' ? `${this.service.origin}/` : this.server.base;
  }

  client(token = ''): TestClient {
    return new TestClient(this.service.origin, token);
  }

  async close(): Promise<void> {
    await leave(this.browser);
    this.server.close();
    await this.service.close();
  }
}
