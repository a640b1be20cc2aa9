/** The upload of this page. It goes on while other parts of the page are shown. */

import type { UploadJob } from './uploadJob';

let job: UploadJob | null = null;

/** The upload that is running or over; null before the first and after it was put away. */
export function currentJob(): UploadJob | null {
  return job;
}

/** Makes it the upload of the page, and has the browser ask before the page is left while it is at work. */
export function setCurrentJob(next: UploadJob | null) {
  job?.removeEventListener('change', guardPage);
  job = next;
  job?.addEventListener('change', guardPage);
  guardPage();
}

function guardPage() {
  if (job?.isActive) addEventListener('beforeunload', ask);
  else removeEventListener('beforeunload', ask);
}

function ask(event: BeforeUnloadEvent) {
  event.preventDefault();
}
