/** Receives the coded groups of a running session as they close, over broken connections. */

import type { ContainerStream, StoredChunk } from '../container/stream';
import { Backoff } from './backoff';
import { endOf } from './groupStore';
import type { Session } from './messages';
import { connect, type ContainerConnection } from './runningContainer';
import type { Service } from './service';

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
