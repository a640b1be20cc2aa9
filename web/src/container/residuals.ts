import type { ResidualLayers } from '../capture';
import type { Source } from './source';
import { Throughput } from './throughput';

/** What is read sooner was in memory. */
const NO_SECONDS = 0.005;

/** A source whose reading is timed; time in which nothing is read does not count. */
export class MeteredSource implements Source {
  readonly size: number;
  private readonly throughput = new Throughput();
  private reading = 0;
  private since = 0;

  constructor(private readonly source: Source) {
    this.size = source.size;
  }

  /** Bytes per second of late; null before it is known, as of files that are read at once. */
  get bytesPerSecond(): number | null {
    return this.throughput.bytesPerSecond;
  }

  async read(offset: number, length: number, signal?: AbortSignal): Promise<Uint8Array> {
    const began = performance.now();
    if (this.reading++ === 0) this.since = began;
    try {
      const bytes = await this.source.read(offset, length, signal);
      this.count(length, began);
      return bytes;
    } finally {
      this.reading--;
    }
  }

  private count(length: number, began: number) {
    const now = performance.now();
    if (now - began < 1000 * NO_SECONDS) return;
    this.throughput.add(length, (now - this.since) / 1000);
    this.since = now;
  }
}

/** The residual layers of a container. */
export class ContainerResiduals implements ResidualLayers {
  private isLeftOut = false;
  private wasLeftOut = false;

  /** @param onReturn called when blocks that were read without their residual are to be read again */
  constructor(
    readonly bytes: number,
    private readonly source: MeteredSource,
    private readonly onReturn: () => void,
  ) {}

  get bytesPerSecond(): number | null {
    return this.source.bytesPerSecond;
  }

  get leftOut(): boolean {
    return this.isLeftOut;
  }

  set leftOut(leftOut: boolean) {
    this.isLeftOut = leftOut;
    if (leftOut || !this.wasLeftOut) return;
    this.wasLeftOut = false;
    this.onReturn();
  }

  /** Whether the residual of a block is left out that is about to be read. */
  leaveOut(): boolean {
    this.wasLeftOut ||= this.isLeftOut;
    return this.isLeftOut;
  }
}
