/** Imported by every worker: tells the page that its script has come. */

import { STARTED } from './moduleWorker';

self.postMessage(STARTED);
