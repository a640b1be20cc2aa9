import type { Capture, FrameBlock, Residual } from '../capture';
import { BLOCK_BYTES, OFFSET_BYTES } from '../cacheBytes';
import type { Offsets } from './decoder';
import type { FromResidualWorker, ToResidualWorker } from './residualWorker';
import { moduleWorker } from '../moduleWorker';
import residualWorkerAddress from './residualWorker.ts?worker&url';

export interface FrameData {
  /** `rowsPerFrame × 3`. */
  readonly rows: Float32Array;
  readonly offsets: Offsets;
}

/** Gives the rows of a frame to show in place of its own, both `rowsPerFrame × 3`. */
export type FrameEdit = (frame: number, rows: Float32Array) => Float32Array;

/** Frames whose offsets are kept, whatever they take. */
const MIN_OFFSETS = 8;

/**
 * Frames of a capture that are in memory or on their way. Blocks are asked for one after another; residual layers are added up in a worker. Preliminary
 * blocks are shown until the final ones, which are asked for as soon as there are some, can be.
 */
export class FrameStore {
  /** Called whenever a frame that was missing has come. */
  onArrival: () => void = () => undefined;
  /** Called when frames have to be taken out anew: they come from another source. */
  onReplaced: () => void = () => undefined;
  /** Called when frames that are loaded ahead do not come: `frame` and those that are read together with it. */
  onFailure: (frame: number, error: unknown) => void = () => undefined;
  onBlock: (block: FrameBlock) => void = () => undefined;
  /** Changes cages as they are taken out, which have the same offsets; null leaves them as they are. */
  edit: FrameEdit | null = null;
  /** In the order of their last use. */
  private readonly blocks = new Set<FrameBlock>();
  /** First frames of the final blocks that are shown in place of preliminary ones. */
  private readonly shownFinal = new Set<number>();
  private readonly offsets = new Map<number, Float32Array>();
  private readonly asked = new Set<number>();
  private readonly loading = new Map<number, Promise<FrameBlock>>();
  /** Loads the next block ahead, whatever else is on its way. */
  private ahead: Promise<void> | null = null;
  /** Loads the final block of a frame that is there from a preliminary one. */
  private finishing: Promise<void> | null = null;
  private readonly atWorker = new Set<number>();
  private waiting: (() => void)[] = [];
  private readonly stop = new AbortController();
  private worker: Worker | null = null;
  /** Why there are no more offsets. */
  private lost: Error | null = null;
  /** How often the source of blocks was replaced. */
  private generation = 0;
  /** Frames whose offsets are needed next, the one that is shown first. */
  private near: readonly number[] = [];
  /** Frames that {@link frame} waits for. */
  private readonly awaited = new Map<number, number>();
  private readonly mostOffsets: number;

  constructor(private readonly capture: Capture) {
    this.mostOffsets = Math.max(MIN_OFFSETS, Math.floor(OFFSET_BYTES / (16 * (capture.static.rest.length / 3))));
    capture.events.addEventListener('replaced', () => this.replace(), { signal: this.stop.signal });
  }

  peek(frame: number): FrameData | null {
    const final = this.find(frame, false);
    const data = final && this.dataOf(final, frame);
    if (data || (final && this.shownFinal.has(final.first))) return data;
    const preliminary = this.find(frame, true);
    return preliminary && this.dataOf(preliminary, frame);
  }

  /** The block of a frame, which is kept. */
  async read(frame: number): Promise<FrameBlock> {
    const kept = this.blockOf(frame);
    if (kept) return kept;
    const block = await this.request(frame);
    this.arrived();
    return block;
  }

  /** Sees to it that a frame comes; resolves when its block has. */
  async load(frame: number): Promise<void> {
    const block = await this.read(frame);
    if (frame < block.first || frame >= block.first + block.count)
      throw new Error(`Frame ${frame} is not where the capture says; load it again.`);
    if (!block.residual || this.offsets.has(frame)) return;
    if (this.lost) throw this.lost;
    this.requestOffsets(block, block.residual, frame);
  }

  /** The frame, once all of it is here. */
  async frame(frame: number): Promise<FrameData> {
    this.awaited.set(frame, (this.awaited.get(frame) ?? 0) + 1);
    try {
      for (;;) {
        await this.load(frame);
        const block = this.blockOf(frame);
        const data = block && this.dataOf(block, frame);
        if (data) return data;
        if (block) await new Promise<void>((resolve) => this.waiting.push(resolve));
      }
    } finally {
      const others = this.awaited.get(frame)! - 1;
      if (others > 0) this.awaited.set(frame, others);
      else this.awaited.delete(frame);
    }
  }

  /**
   * Loads the first of these frames that is missing, and the offsets of those that are there, as many as can be kept. The first one is that which is
   * shown.
   */
  prefetch(frames: Iterable<number>) {
    const ahead = [...frames];
    this.near = ahead.slice(0, this.mostOffsets - 2);
    for (const [k, frame] of ahead.entries()) {
      const block = this.blockOf(frame);
      if (block) {
        const isNear = k < this.near.length;
        if (isNear && block.residual && !this.offsets.has(frame)) this.requestOffsets(block, block.residual, frame);
      } else if (this.find(frame, true)) {
        this.finish(frame);
      } else {
        this.loadAhead(frame);
        return;
      }
    }
  }

  close() {
    this.stop.abort();
    this.forget();
  }

  private replace() {
    this.generation++;
    this.forget();
    for (const resolve of this.waiting.splice(0)) resolve();
    this.onReplaced();
  }

  private forget() {
    if (this.worker) {
      this.worker.onmessage = null;
      this.worker.terminate();
      this.worker = null;
    }
    const { blocks, offsets, asked, loading, atWorker, shownFinal } = this;
    for (const kept of [blocks, offsets, asked, loading, atWorker, shownFinal]) kept.clear();
    this.ahead = null;
    this.finishing = null;
  }

  /** The block of a frame that needs no other one: a preliminary one only as long as there is no final one. */
  private blockOf(frame: number): FrameBlock | null {
    return this.find(frame, false) ?? (this.capture.hasFinal?.(frame) ? null : this.find(frame, true));
  }

  private find(frame: number, isPreliminary: boolean): FrameBlock | null {
    for (const block of this.blocks) {
      const { first, count } = block;
      if (frame < first || frame >= first + count || (block.isPreliminary ?? false) !== isPreliminary) continue;
      // Moved to the end, as the one used last.
      this.blocks.delete(block);
      this.blocks.add(block);
      return block;
    }
    return null;
  }

  private dataOf({ first, cages, residual }: FrameBlock, frame: number): FrameData | null {
    const width = 3 * this.capture.static.rowsPerFrame;
    const rows = cages.subarray((frame - first) * width, (frame - first + 1) * width);
    const offsets = residual ? this.offsets.get(frame) : null;
    return offsets === undefined ? null : { rows: this.edit?.(frame, rows) ?? rows, offsets };
  }

  private loadAhead(frame: number) {
    if (this.ahead) return;
    const ahead = this.load(frame)
      .catch((error: unknown) => this.onFailure(frame, error))
      .finally(() => {
        if (this.ahead === ahead) this.ahead = null;
      });
    this.ahead = ahead;
  }

  /** Loads the final block of a frame, one at a time; the preliminary one is shown meanwhile. */
  private finish(frame: number) {
    if (this.finishing) return;
    const finishing = this.load(frame)
      // Where it does not come, the frame stays as it is.
      .catch(() => undefined)
      .finally(() => {
        if (this.finishing === finishing) this.finishing = null;
      });
    this.finishing = finishing;
  }

  /** A final block can be shown: whatever shows frames of it from preliminary ones is to show them anew. */
  private showFinal(final: FrameBlock) {
    if (this.shownFinal.has(final.first)) return;
    this.shownFinal.add(final.first);
    const replaces = (block: FrameBlock) =>
      block.isPreliminary && block.first < final.first + final.count && final.first < block.first + block.count;
    if ([...this.blocks].some(replaces)) this.onReplaced();
  }

  private request(frame: number): Promise<FrameBlock> {
    const running = this.loading.get(frame);
    if (running) return running;
    const { generation } = this;
    const loading = this.capture
      .block(frame, this.stop.signal)
      .then((block) => {
        // It may have been on its way when its source was replaced.
        if (generation !== this.generation) return this.request(frame);
        this.keep(block);
        return block;
      })
      .finally(() => {
        if (this.loading.get(frame) === loading) this.loading.delete(frame);
      });
    this.loading.set(frame, loading);
    return loading;
  }

  private keep(block: FrameBlock) {
    this.onBlock(block);
    let bytes = bytesOf(block);
    for (const held of this.blocks) {
      if (held.first === block.first && held.isPreliminary === block.isPreliminary) this.blocks.delete(held);
      else bytes += bytesOf(held);
    }
    this.blocks.add(block);
    for (const held of this.blocks) {
      if (bytes <= BLOCK_BYTES || held === block) break;
      bytes -= bytesOf(held);
      this.blocks.delete(held);
      if (held.isPreliminary) continue;
      this.shownFinal.delete(held.first);
      if (this.atWorker.delete(held.first)) this.send({ kind: 'forget', block: held.first });
    }
    if (!block.isPreliminary && !block.residual) this.showFinal(block);
  }

  private requestOffsets(block: FrameBlock, residual: Residual, frame: number) {
    if (this.lost || this.asked.has(frame) || frame < block.first || frame >= block.first + block.count) return;
    this.asked.add(frame);
    if (!this.atWorker.has(block.first)) {
      this.atWorker.add(block.first);
      this.send({ kind: 'block', block: block.first, points: this.capture.static.rest.length / 3, residual });
    }
    this.send({ kind: 'frame', block: block.first, index: frame - block.first });
  }

  /** The worker does not answer any more: whoever waits for offsets hears it. */
  private lose(error: Error) {
    this.lost = error;
    this.asked.clear();
    this.arrived();
  }

  private receive({ block, index, offsets }: FromResidualWorker) {
    const frame = block + index;
    this.asked.delete(frame);
    this.offsets.set(frame, offsets);
    this.evictOffsets();
    const final = this.find(frame, false);
    if (final) this.showFinal(final);
    this.arrived();
  }

  /** Drops the offsets farthest from the frame that is shown; what is needed next is never more than what is kept. */
  private evictOffsets() {
    while (this.offsets.size > this.mostOffsets) {
      const shown = this.near[0] ?? 0;
      let farthest = -1;
      for (const frame of this.offsets.keys()) {
        if (this.near.includes(frame) || this.awaited.has(frame)) continue;
        if (farthest < 0 || Math.abs(frame - shown) > Math.abs(farthest - shown)) farthest = frame;
      }
      if (farthest < 0) return;
      this.offsets.delete(farthest);
    }
  }

  private arrived() {
    for (const resolve of this.waiting.splice(0)) resolve();
    this.onArrival();
  }

  private send(message: ToResidualWorker) {
    if (!this.worker) {
      const worker = moduleWorker(residualWorkerAddress, (error) => {
        if (this.worker === worker) this.lose(error);
      });
      worker.onmessage = ({ data }: MessageEvent<FromResidualWorker>) => this.receive(data);
      this.worker = worker;
    }
    this.worker.postMessage(message);
  }
}

function bytesOf({ cages, residual }: FrameBlock): number {
  return cages.byteLength + (residual ? residual.shapes.byteLength + residual.correctionVectors.byteLength : 0);
}
