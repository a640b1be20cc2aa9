/** The coded groups of a running session that are closed: held as they are coded, and decoded when they are looked at. */

import type { FrameBlock, StaticPart } from '../capture';
import { BlockCache } from '../container/blockCache';
import { BlockDecoder } from '../container/blocks';
import { isDamage } from '../container/error';
import { HEADER_BYTES } from '../container/section';
import type { Source } from '../container/source';
import { type Codec, createCodec } from '../codec/client';
import { basisRows } from './basisRows';
import { GroupStore, endOf } from './groupStore';
import type { Session } from './messages';
import { type ContainerConnection, connect } from './runningContainer';
import type { Service } from './service';
import type { ContainerStream, StoredChunk } from '../container/stream';
import { Backoff } from './backoff';

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

/** A connection that brought nothing for so long, though groups have closed, is taken for dead: a lost network does not end it. */
const SILENT_SECONDS = 15;
/** Bytes that may be sent again whenever a connection broke. */
const FREE_BYTES = 4 << 20;

/**
 * Follows one session's container. The service sends that from its front only, so a connection that takes the place of a broken one is sent again
 * what is here already. One is made where groups have closed meanwhile, and where it is sent no more again, but for a few megabytes, than it and
 * the one before bring that is new: however often connections break, about three times the container is received in all.
 */
export class GroupFollower {
  /** Frames of the groups that came. */
  frames = 0;
  /** Bytes that a frame takes in them; null before it is known. */
  bytesPerFrame: number | null = null;
  private connection: ContainerConnection | null = null;
  private isClosed = false;
  /** Bytes of the container that are known, and how many of them the last connection brought. */
  private bytes = 0;
  private newBytes = 0;
  private lastPieceAt = 0;
  /** When the next connection may be made, of `performance.now()`. */
  private earliest = 0;
  private readonly backoff = new Backoff();

  /** @param connection by which the static part came */
  constructor(
    private readonly service: Service,
    private readonly id: string,
    private readonly onGroup: (group: StoredChunk) => void,
    connection: ContainerConnection,
    private readonly freeBytes = FREE_BYTES,
  ) {
    void this.receive(connection);
  }

  /** A look at the session: where nothing follows it and groups have closed, they are asked for. */
  looked({ coding }: Session) {
    if (!coding || coding.frames <= this.frames) return;
    const now = performance.now();
    if (this.connection) {
      if (now - this.lastPieceAt > 1000 * SILENT_SECONDS) this.connection.stop.abort();
      return;
    }
    const waiting = coding.bytes * (1 - this.frames / coding.frames);
    if (this.isClosed || now < this.earliest || this.bytes > this.freeBytes + this.newBytes + waiting) return;
    this.newBytes = 0;
    void this.receive(connect(this.service, this.id));
  }

  close() {
    this.isClosed = true;
    this.connection?.stop.abort();
  }

  private async receive(connection: ContainerConnection) {
    const { stream, pieces } = connection;
    this.connection = connection;
    this.lastPieceAt = performance.now();
    try {
      this.take(stream, new Uint8Array(0));
      for await (const piece of pieces) {
        this.lastPieceAt = performance.now();
        this.take(stream, piece);
      }
    } catch {
      // Looks at the session ask again, and whoever follows its cages says what is wrong.
    } finally {
      connection.stop.abort();
      this.connection = null;
      this.earliest = performance.now() + 1000 * this.backoff.next();
    }
  }

  private take(stream: ContainerStream, piece: Uint8Array) {
    for (const group of stream.push(piece)) {
      if (endOf(group) <= this.frames) continue;
      this.frames = endOf(group);
      this.backoff.reset();
      this.onGroup(group);
    }
    this.bytesPerFrame = stream.bytesPerFrame ?? this.bytesPerFrame;
    const more = Math.max(0, stream.received - this.bytes);
    this.bytes += more;
    this.newBytes += more;
  }
}
