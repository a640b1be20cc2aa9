/** Runs a {@link GroupDecoder} beside the page: each message is a call of one of its methods. */

import '../workerStarted';
import { CodedDataError } from './error';
import { GroupDecoder } from './groupDecoder';
import type { Answer, Call } from './messages';
import { transferables } from './messages';
import { sentence } from '../text';

const decoder = new GroupDecoder();

self.onmessage = ({ data }: MessageEvent<Call>) => {
  const { id, method, args } = data;
  let answer: Answer;
  try {
    const call = decoder[method] as (this: GroupDecoder, ...args: unknown[]) => unknown;
    answer = { id, result: call.apply(decoder, args) };
  } catch (error) {
    answer = { id, failure: sentence(error), damaged: error instanceof CodedDataError };
  }
  postMessage(answer, { transfer: transferables(answer) });
};
