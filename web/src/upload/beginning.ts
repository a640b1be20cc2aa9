/** The beginning of an upload, from files and what was chosen for them. */

import type { Service } from '../service/service';
import type { Dropped, Item } from '../files/classify';
import { marksOf } from './fileMarks';
import { KeptUpload, newKey } from './keptUpload';
import { type Choices, designOf, optionsOf } from './optionsForm';
import type { Plan } from './plan';
import { UploadJob } from './uploadJob';

export function newUpload(service: Service, plan: Plan, choices: Choices, items: readonly Item[]): KeptUpload {
  return new KeptUpload({
    key: newKey(),
    service: service.address(''),
    begun: Date.now(),
    choices,
    marks: marksOf(items),
    frames: plan.frames.frames,
    session: null,
    design: null,
  });
}

/** Sends a plan as it was asked for when its upload began. */
export function jobOf(service: Service, plan: Plan, kept: KeptUpload): UploadJob {
  const { choices } = kept.present;
  const { frames, cage } = plan;
  const request = {
    options: optionsOf(choices, frames.frames, cage !== null),
    design: designOf(choices, cage !== null),
  };
  return new UploadJob(service, plan, request, kept);
}

/** What files and folders are called that say nothing of what is in them. */
const SAYS_NOTHING =
  /^(frames?|anim(ation)?s?|positions?|points|vertices|rest([-_ ]?pose)?|cage|mesh|model|capture)?[-_. ]*\d*$/i;

/** A name for a capture: that of the folder that was dropped, of the file of the frames or of the rest pose, the first one that says something; else the date. */
export function captureName(plan: Plan, dropped: readonly Dropped[], items: readonly Item[]): string {
  const path = dropped.find(({ path }) => path.includes('/'))?.path;
  const frames = items.find((item) => item.role === 'frames')?.files[0];
  const names = [path?.split('/')[0], ...[frames, plan.rest].map((file) => file?.name.replace(/\.[^.]*$/, ''))];
  const date = new Date().toLocaleString('en-GB', { dateStyle: 'medium', timeStyle: 'short' });
  return names.find((name) => name !== undefined && !SAYS_NOTHING.test(name)) ?? `Capture of ${date}`;
}
