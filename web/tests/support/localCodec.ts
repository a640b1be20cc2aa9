import type { Codec } from '../../src/codec/client';
import { GroupDecoder } from '../../src/codec/groupDecoder';
import type { Arguments, Method, Result } from '../../src/codec/messages';

/** Decodes in the calling thread, where there are no workers, as in Node. */
export class LocalCodec implements Codec {
  private readonly decoder = new GroupDecoder();

  call<M extends Method>(method: M, args: Arguments<M>): Promise<Result<M>> {
    const call = this.decoder[method] as (this: GroupDecoder, ...args: Arguments<M>) => Result<M>;
    return new Promise((resolve) => resolve(call.apply(this.decoder, args)));
  }

  close(): void {
    // Nothing runs on.
  }
}
