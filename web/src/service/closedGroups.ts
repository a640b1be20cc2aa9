/** The coded groups of a running session that are closed: held as they are coded, and decoded when they are looked at. */

import type { FrameBlock, StaticPart } from '../capture';
import { BlockCache } from '../container/blockCache';
import { BlockDecoder } from '../container/blocks';
import { isDamage } from '../container/error';
import { HEADER_BYTES } from '../container/section';
import type { Source } from '../container/source';
import { type Codec, createCodec } from '../codec/client';
import { basisRows } from './basisRows';
import { GroupFollower } from './groupFollower';
import { GroupStore } from './groupStore';
import type { Session } from './messages';
import type { ContainerConnection } from './runningContainer';
import type { Service } from './service';

/** Seconds after which a group is decoded again that could not be decoded; a damaged one is not. */
const RETRY_SECONDS = 10;

export interface GroupListener {
  readonly arrived: () => void;
  /** A group cannot be shown as it was coded. */
  readonly failed: (error: unknown) => void;
}

export class ClosedGroups {
  private readonly store = new GroupStore();
  private readonly follower: GroupFollower;
  private readonly codec: Codec = createCodec();
  private readonly decoder: BlockDecoder;
  private readonly cache = new BlockCache((first, signal) => this.decode(first, signal));
  /** First frames of groups that could not be decoded, and when it is tried again, of `performance.now()`. */
  private readonly failed = new Map<number, number>();
  private readonly closing = new AbortController();

  /** @param connection by which the static part came, and the groups follow */
  constructor(
    service: Service,
    { id, coordinates }: Session,
    part: StaticPart,
    connection: ContainerConnection,
    private readonly listener: GroupListener,
  ) {
    // The page cannot compute these coordinates, and coded cages are decoded with them.
    this.decoder = new BlockDecoder(
      part,
      this.codec,
      coordinates === 'harmonic' ? basisRows(service, id, this.closing.signal) : null,
    );
    const take = (group: Parameters<GroupStore['put']>[0]) => {
      this.store.put(group);
      listener.arrived();
    };
    this.follower = new GroupFollower(service, id, take, connection);
  }

  /** Bytes that a frame takes in the groups; null before it is known. */
  get bytesPerFrame(): number | null {
    return this.follower.bytesPerFrame;
  }

  /** The frames of the group that a frame belongs to, where that is here and can be decoded as far as known. */
  of(frame: number): { readonly first: number; readonly count: number } | null {
    const fields = this.store.of(frame)?.frames.entry.fields;
    if (this.closing.signal.aborted || !fields || performance.now() < (this.failed.get(fields.first) ?? 0)) return null;
    return fields;
  }

  /** The decoded group of a frame; null where {@link of} gives none, or it cannot be decoded. */
  async block(frame: number, signal?: AbortSignal): Promise<FrameBlock | null> {
    const group = this.of(frame);
    if (!group) return null;
    try {
      const block = await this.cache.get(group.first, signal);
      const next = this.of(group.first + group.count);
      if (next) this.cache.prefetch(next.first);
      return block;
    } catch (error) {
      signal?.throwIfAborted();
      if (this.closing.signal.aborted) return null;
      this.failed.set(group.first, isDamage(error) ? Infinity : performance.now() + 1000 * RETRY_SECONDS);
      this.listener.failed(error);
      return null;
    }
  }

  /** Φ, which decoding needs as well. */
  phi(onProgress: (fraction: number) => void, signal: AbortSignal): Promise<Float32Array> {
    return this.decoder.phi(onProgress, signal);
  }

  looked(session: Session) {
    if (!this.closing.signal.aborted) this.follower.looked(session);
  }

  /** The container once the session is completed, of which groups that are here are not read again; see {@link GroupStore.source}. */
  source(source: Source, frames: number): Source {
    return this.store.source(source, frames);
  }

  close() {
    this.closing.abort();
    this.follower.close();
    this.cache.clear();
    this.codec.close();
  }

  private async decode(first: number, signal: AbortSignal): Promise<FrameBlock> {
    const group = this.store.of(first);
    if (!group) throw new Error('The group was given up.');
    const { frames, residual } = group;
    const bytes = frames.entry.offset + HEADER_BYTES + frames.payload.length;
    const { block, problem } = await this.decoder.decode(frames, residual, bytes, signal);
    if (problem) this.listener.failed(problem);
    return block;
  }
}
