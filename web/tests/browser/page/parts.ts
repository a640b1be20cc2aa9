/** A page of parts without the viewer around them: the list, the upload, and what opens sessions, for tests to ask. */

import type { Capture } from '../../../src/capture';
import { openSession } from '../../../src/service/live';
import { Service } from '../../../src/service/service';
import { pageToken } from '../../../src/service/token';
import '../../../src/sessions/cagerSessions';
import { page, tokens } from '../../../src/style/tokens';
import '../../../src/upload/cagerUpload';

declare global {
  interface Window {
    parts: {
      openSession: typeof openSession;
      pageToken: typeof pageToken;
      Service: typeof Service;
      capture?: Capture;
    };
  }
}

window.parts = { openSession, pageToken, Service };
document.adoptedStyleSheets = [tokens.styleSheet!, page.styleSheet!];

function show(): void {
  const name = location.hash.startsWith('#/upload') ? 'cager-upload' : location.hash === '#/' ? 'cager-sessions' : null;
  document.body.replaceChildren(...(name ? [document.createElement(name)] : []));
}

addEventListener('hashchange', show);
show();
